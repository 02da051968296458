#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "geometry/pose3.h"

namespace relocd {

/// An estimate, and the truth at its time.
struct PosePair {
  std::int64_t time_ns = 0;
  Pose3 X_WB_true;
  Pose3 X_WB;
};

/// What a set of errors amounts to, in the errors' unit.
struct ErrorSummary {
  std::size_t count = 0;
  double mean = 0.0;
  double rmse = 0.0;
  double median = 0.0;  ///< Of an even count the mean of the middle two.
  double p95 = 0.0;     ///< The smallest error that 95 % of the errors do not exceed.
  double max = 0.0;
};

/// All zero for no errors, which must be finite.
ErrorSummary Summarize(std::vector<double> errors);

/// The distance between the estimated and the true position, in m, for each pair.
std::vector<double> PositionErrors(std::span<const PosePair> pairs);
/// The angle between the estimated and the true rotation, in [0, pi] rad, for each pair.
std::vector<double> RotationErrors(std::span<const PosePair> pairs);

/// The rigid transform of the estimates that brings their positions closest to the true ones: in
/// the plane (x, y, yaw) if `planar`, else in space. Fails as AlignPoints does.
Result<Pose3> AlignToTruth(std::span<const PosePair> pairs, bool planar);

/// How the estimated motion over a piece of the way differs from the true one: the relative pose
/// error of J. Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", 2012.
struct RelativeError {
  double translation_m = 0.0;
  double rotation_rad = 0.0;
  double travelled_m = 0.0;  ///< Along the truth.
  double duration_s = 0.0;
};

/// From each pair to the first one that is at least `distance_m` further along the truth.
std::vector<RelativeError> RelativeErrorsOverDistance(std::span<const PosePair> pairs,
                                                      double distance_m);
/// From each pair to the first one that is at least `duration_ns` later.
std::vector<RelativeError> RelativeErrorsOverTime(std::span<const PosePair> pairs,
                                                  std::int64_t duration_ns);

/// How well reported covariances describe the errors.
struct Coverage {
  std::size_t position_count = 0;
  std::size_t pose_count = 0;   ///< Of these, with a heading.
  double position_share = 0.0;  ///< Of the errors (x, y) inside their 95 % ellipse: 0.95 is honest.
  double pose_share = 0.0;      ///< Of the errors (x, y, yaw) inside their 95 % ellipsoid.
  double position_nees = 0.0;   ///< Mean of the squared Mahalanobis distances; 2 is honest.
  double pose_nees = 0.0;       ///< 3 is honest.
};

/// Takes errors and the covariances that were reported for them.
class CoverageCounter {
 public:
  /// @param error       X_WB * Exp(error) is the truth.
  /// @param covariance  3x3 of that right perturbation (x, y, yaw), positive definite.
  void Add(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance);

  /// Of an estimate or a truth without a heading, both in the same axes.
  void AddPosition(const Eigen::Vector2d& error, const Eigen::Matrix2d& covariance);

  [[nodiscard]] Coverage Total() const;

 private:
  std::size_t position_count_ = 0;
  std::size_t pose_count_ = 0;
  std::size_t positions_inside_ = 0;
  std::size_t poses_inside_ = 0;
  double position_sum_ = 0.0;
  double pose_sum_ = 0.0;
};

}  // namespace relocd
