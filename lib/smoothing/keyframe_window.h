#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <ceres/cost_function.h>

#include "core/time.h"
#include "geometry/planar.h"
#include "geometry/pose2.h"
#include "smoothing/fix.h"

namespace relocd {

/// A pose that is estimated, and the composed odometry that leads to it.
struct Keyframe {
  std::int64_t id = 0;  ///< One more than the keyframe before.
  MonotonicTime time{};
  Pose2 X_OB;
  std::array<double, 3> x_WK{};  ///< The estimate X_WK, as Ceres sees it.
  Pose2 X_PK;                    ///< The motion from the keyframe before (P).
  Eigen::Matrix3d covariance_PK = Eigen::Matrix3d::Identity();
  std::unique_ptr<ceres::CostFunction> motion_residual;  ///< Null in the very first.
  /// How often the estimates had been started anew when this one was last estimated.
  std::int64_t generation = 0;
  bool is_cut =
      false;  ///< The body was carried here: the motion from the keyframe before is wrong.

  [[nodiscard]] Pose2 X_WK() const { return {x_WK[0], x_WK[1], x_WK[2]}; }
  void SetX_WK(const Pose2& X_WK) { x_WK = {X_WK.x(), X_WK.y(), X_WK.yaw()}; }
};

/// A fix at the place F, and the motion to F from the keyframe before it.
struct AttachedFix {
  Fix fix;
  std::int64_t keyframe_id = 0;
  Pose2 X_KF;
  Eigen::Matrix3d covariance_KF = Eigen::Matrix3d::Zero();
  bool is_extrapolated =
      false;              ///< X_KF is a prediction, to be replaced when the odometry is there.
  bool is_gated = false;  ///< Kept, but without influence.
  std::unique_ptr<ceres::CostFunction> residual;
};

/// How fixes are weighted: the Cauchy kernel, and their correlation with each other.
class FixWeighting {
 public:
  FixWeighting(double cauchy_scale_sigmas, double correlation_time_s);

  [[nodiscard]] double cauchy_scale_sigmas() const { return cauchy_scale_sigmas_; }
  [[nodiscard]] double correlation_time_s() const { return correlation_time_s_; }
  /// How much more a fix under the kernel tells, when errors are Gaussian, than its weight says.
  [[nodiscard]] double InformationCorrection(bool has_heading) const {
    return (has_heading ? correction_with_heading_ : correction_without_heading_) / misfit_;
  }
  /// Mean square of a fix's pull, its whitened position error times its weight, when errors are
  /// Gaussian.
  [[nodiscard]] double ExpectedSquaredPull() const { return expected_squared_pull_; }
  /// The same, for covariances, with every fix telling `misfit` times less.
  [[nodiscard]] FixWeighting WithMisfit(double misfit) const {
    FixWeighting weighting = *this;
    weighting.misfit_ = misfit;
    return weighting;
  }

 private:
  double cauchy_scale_sigmas_;
  double correlation_time_s_;
  double correction_with_heading_;
  double correction_without_heading_;
  double expected_squared_pull_;
  double misfit_ = 1.0;
};

/// A chain of keyframes with fixes on them, and what is known of its oldest from those before.
struct KeyframeWindow {
  std::deque<Keyframe> keyframes;
  std::deque<AttachedFix> fixes;                  ///< By time.
  std::optional<PlanarPose> prior;                ///< Of the oldest keyframe.
  std::optional<MonotonicTime> last_removed_fix;  ///< The next one may be correlated with it.

  [[nodiscard]] bool Has(std::int64_t keyframe_id) const;
  [[nodiscard]] Keyframe& Get(std::int64_t keyframe_id);
  [[nodiscard]] const Keyframe& Get(std::int64_t keyframe_id) const;
  [[nodiscard]] Pose2 X_WF(const AttachedFix& fix) const;
};

/// Makes the residual of an attached fix from its other members.
std::unique_ptr<ceres::CostFunction> MakeFixResidual(const AttachedFix& fix);
/// Makes the residual of a keyframe's motion from its other members.
std::unique_ptr<ceres::CostFunction> MakeMotionResidual(const Keyframe& keyframe);

/// Moves the estimates to a minimum of the squared residuals, nearer by `max_iterations` steps.
///
/// One thread, no clock, one solver: the same window gives the same bits on each run.
///
/// @return whether the estimates are usable; if not, they are as before.
bool Solve(KeyframeWindow& window, const FixWeighting& weighting, int max_iterations);

/// By how much the fixes' pull on the estimates varies more than that of independent fixes with the
/// stated covariances would, at least 1: errors that last, as those of a network that knows a place
/// badly, average out more slowly than their number says.
///
/// The long-run variance of Newey and West (1987) of the fixes' pulls over that expected. With few
/// fixes it leans on what is usual for scene coordinates: eight that count as one.
double EstimateMisfit(const KeyframeWindow& window, const FixWeighting& weighting);

/// Covariance of the newest keyframe's right perturbation given all in the window, linearised at
/// the estimates: the prior carried through the chain, motion by motion and fix by fix, which is
/// the elimination of all other keyframes, in 3x3 blocks.
Eigen::Matrix3d NewestCovariance(const KeyframeWindow& window, const FixWeighting& weighting);

/// The same for every keyframe, given also what comes after it.
std::vector<Eigen::Matrix3d> SmoothedCovariances(const KeyframeWindow& window,
                                                 const FixWeighting& weighting);

/// Removes the oldest keyframe and its fixes, and leaves what they say of the next one as its
/// prior. The window must have two keyframes.
///
/// @return what was removed.
struct RemovedKeyframe {
  Keyframe keyframe;
  std::vector<AttachedFix> fixes;
};
RemovedKeyframe MarginalizeOldest(KeyframeWindow& window, const FixWeighting& weighting);

}  // namespace relocd
