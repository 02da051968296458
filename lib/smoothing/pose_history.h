#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "core/time.h"
#include "geometry/pose2.h"
#include "smoothing/sliding_vector.h"

namespace relocd {

/// Where the body stood in the odometry frame at one time, and how it came there from the keyframe
/// K before it.
struct OdometrySample {
  MonotonicTime time{};
  Pose2 X_OB;
  std::int64_t keyframe_id = 0;
  Pose2 X_KB;
  Eigen::Matrix3d covariance_KB = Eigen::Matrix3d::Zero();  ///< Of X_KB's right perturbation.
  Eigen::Matrix3d step_covariance =
      Eigen::Matrix3d::Zero();  ///< Of the motion from the sample before.
  bool is_extrapolated = false;
};

/// The last seconds of odometry, to look up where the body was when an image was taken.
///
/// Covariances are kept since the last keyframe, not since the start: the difference of two large
/// ones would lose its digits after some kilometres. Thread-bound.
class PoseHistory {
 public:
  PoseHistory(Duration reach, Duration max_extrapolation)
      : reach_(reach), max_extrapolation_(max_extrapolation) {}

  /// The time must be above the newest sample's. Forgets what is older than the reach.
  void Push(const OdometrySample& sample);

  /// The sample at a time: interpolated along the screw between its neighbours; after the newest,
  /// and no more than the maximal extrapolation after, moved on with the last velocity.
  ///
  /// @return nothing before the oldest sample, or too far after the newest.
  [[nodiscard]] std::optional<OdometrySample> At(MonotonicTime time) const;

  /// Velocities are means over so much before a time, and as much after it.
  static constexpr Duration kVelocityReach = std::chrono::milliseconds(500);

  /// The velocity (x, y, yaw) along the body's axes, in m/s and rad/s; after the newest sample, and
  /// nearly there, what is known of it then.
  ///
  /// @return nothing too near to the oldest sample, or beyond any vehicle's: there the odometry
  /// jumped.
  [[nodiscard]] std::optional<Eigen::Vector3d> VelocityAt(MonotonicTime time) const;

  [[nodiscard]] bool empty() const { return samples_.empty(); }
  [[nodiscard]] const OdometrySample& newest() const { return samples_.back(); }
  [[nodiscard]] const OdometrySample& oldest() const { return samples_.front(); }

 private:
  /// `before` moved on by `share` of the step to `after`.
  static OdometrySample MoveOn(const OdometrySample& before,
                               const OdometrySample& after,
                               double share);
  [[nodiscard]] std::optional<OdometrySample> Extrapolate(MonotonicTime time) const;

  Duration reach_;
  Duration max_extrapolation_;
  SlidingVector<OdometrySample> samples_;
};

}  // namespace relocd
