#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "core/time.h"
#include "geometry/planar.h"
#include "geometry/pose2.h"
#include "smoothing/absolute_pose_residual.h"
#include "smoothing/fix.h"
#include "smoothing/relative_pose_residual.h"
#include "smoothing/sliding_vector.h"

namespace relocd {

/// How far the odometry has gone: that by which it can drift.
struct MotionExtent {
  double way_m = 0.0;
  double driven_s = 0.0;  ///< But for the time in which it measured no motion at all.

  /// Of one motion. One of exactly zero is that of a body which is known to stand.
  static MotionExtent Of(const Pose2& motion, double seconds) {
    const double way_m = motion.translation().norm();
    return {way_m, way_m > 0.0 || motion.yaw() != 0.0 ? seconds : 0.0};
  }
  MotionExtent& operator+=(const MotionExtent& more) {
    way_m += more.way_m;
    driven_s += more.driven_s;
    return *this;
  }
  friend MotionExtent operator-(const MotionExtent& a, const MotionExtent& b) {
    return {a.way_m - b.way_m, a.driven_s - b.driven_s};
  }
};

/// A pose that is estimated, and the composed odometry that leads to it.
struct Keyframe {
  std::int64_t id = 0;  ///< One more than the keyframe before.
  MonotonicTime time{};
  Pose2 X_OB;
  Eigen::Vector3d x_WK = Eigen::Vector3d::Zero();  ///< The estimate X_WK: x, y, unwrapped yaw.
  Pose2 X_PK;                                      ///< The motion from the keyframe before (P).
  Eigen::Matrix3d covariance_PK = Eigen::Matrix3d::Identity();
  /// The part of it that is there because the odometry's drift was not known better.
  Eigen::Matrix3d drift_covariance_PK = Eigen::Matrix3d::Zero();
  MotionExtent extent;              ///< Until here.
  double corrected_turn_rad = 0.0;  ///< Put into the odometry until here, by OdometryDrift.
  double corrected_way_m = 0.0;     ///< Likewise.
  /// How often the estimates had been started anew when this one was last estimated.
  std::int64_t generation = 0;
  int fixes = 0;        ///< That are attached to it and have influence.
  int gated_fixes = 0;  ///< That are attached to it and have none.
  bool is_cut =
      false;  ///< The body was carried here: the motion from the keyframe before is wrong.

  [[nodiscard]] Pose2 X_WK() const { return {x_WK.x(), x_WK.y(), x_WK.z()}; }
  void SetX_WK(const Pose2& X_WK) { x_WK << X_WK.translation(), X_WK.yaw(); }
  [[nodiscard]] RelativePoseResidual MotionResidual() const { return {X_PK, covariance_PK}; }
};

/// The derivative of a planar tangent by a camera's offset.
using ByCameraOffset = Eigen::Matrix<double, 3, 2>;

/// What keyframes say of a camera's offset: information * (offset - estimate) = rhs. Of the rhs, a
/// bias of the fixes makes a part, given here for a bias of sigma one.
struct CameraKnowledge {
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d rhs = Eigen::Vector2d::Zero();
  Eigen::Matrix2d bias_covariance = Eigen::Matrix2d::Zero();
  Eigen::Matrix<double, 2, 3> bias_cross = Eigen::Matrix<double, 2, 3>::Zero();  ///< With the bias.
};

/// What a camera's offset does to an estimate, along W's axes, whose covariance is for a known one.
struct CameraEffect {
  ByCameraOffset by_camera = ByCameraOffset::Zero();
  /// Covariance of what the fixes' bias makes of the knowledge's rhs and of the estimate.
  Eigen::Matrix<double, 2, 3> bias_cross = Eigen::Matrix<double, 2, 3>::Zero();
};

/// What a camera gets wrong in all its fixes alike, as (yaw, time): it looks so many radians
/// farther to the left than the config says, and its fixes' times are so many seconds late.
///
/// Two constants with Gaussian priors about zero. With several cameras it is what they have in
/// common.
struct CameraOffset {
  Eigen::Vector2d prior_sigmas = Eigen::Vector2d::Zero();  ///< Of 0: it is not looked for.
  Eigen::Vector2d estimate = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  CameraKnowledge before_window = {};  ///< From the keyframes that have left it.

  [[nodiscard]] bool IsSought() const { return prior_sigmas.maxCoeff() > 0.0; }
};

/// A fix at the place F, and the motion to F from the keyframe before it: that of the body B at the
/// fix's time, and what the camera's offset makes of it.
struct AttachedFix {
  Fix fix;
  std::int64_t keyframe_id = 0;
  Pose2 X_KB;
  Eigen::Matrix3d covariance_KB = Eigen::Matrix3d::Zero();
  ByCameraOffset X_BF_by_camera = ByCameraOffset::Zero();  ///< X_BF = Pose2(this * offset).
  Pose2 X_KF;                                              ///< With the present estimate.
  bool is_provisional = false;  ///< To be attached anew when the odometry has gone on.
  bool is_gated = false;        ///< Kept, but without influence.
  double share = 0.0;           ///< Of it that is news, by UpdateShares.
  /// The lower triangular root of its own covariance along W's axes: what a bias of one is in it.
  Eigen::Matrix3d covariance_root = Eigen::Matrix3d::Zero();
  AbsolutePoseResidual residual;

  /// X_KF with another camera offset.
  [[nodiscard]] Pose2 MotionWith(const Eigen::Vector2d& camera_offset) const;
  /// The derivative of the residual's error by the camera's offset, where K looks to `yaw_WK`.
  [[nodiscard]] ByCameraOffset ErrorByCamera(double yaw_WK) const;
};

/// Fills in `X_KF`, `residual` and `covariance_root` from the other members.
void PrepareResidual(AttachedFix& fix, const Eigen::Vector2d& camera_offset = {0.0, 0.0});

/// Neighbouring fixes err together by a slowly varying bias: a Gauss-Markov process along W's axes.
struct FixBias {
  double sigmas = 0.0;   ///< Its standard deviation, as a part of each fix's own error.
  double time_s = 10.0;  ///< After which 1/e of it is left.
};

/// The part of an estimate's error that the fixes' bias makes, for a bias of sigma one.
struct FixBiasEffect {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();  ///< Covariance with the bias of this moment.
};

/// How fixes are weighted: by a Cauchy kernel, and by how much they err together.
class FixWeighting {
 public:
  FixWeighting(double cauchy_scale_sigmas, double correlation_time_s, const FixBias& bias = {});

  [[nodiscard]] double cauchy_scale_sigmas() const { return cauchy_scale_sigmas_; }
  [[nodiscard]] double correlation_time_s() const { return correlation_time_s_; }

  /// As a part of what the fixes' covariances say.
  [[nodiscard]] double BiasVariance() const { return scatter_ * bias_.sigmas * bias_.sigmas; }
  /// The part of a bias that is left after a time.
  [[nodiscard]] double BiasKept(double seconds) const { return std::exp(-seconds / bias_.time_s); }

  /// A fix weighs so many times what its covariance says, before the kernel and the misfit: its
  /// share that is news, and what the kernel takes from good fixes for its own sake alone.
  [[nodiscard]] double BaseWeight(const AttachedFix& fix) const {
    return fix.share *
           (fix.fix.has_heading ? correction_with_heading_ : correction_without_heading_);
  }
  /// The kernel's weight of a squared error in squared standard deviations.
  [[nodiscard]] double KernelWeight(double squared_error) const {
    return 1.0 / (1.0 + squared_error / (cauchy_scale_sigmas_ * cauchy_scale_sigmas_));
  }
  /// All fixes tell so many times less than if they erred independently.
  [[nodiscard]] double misfit() const { return misfit_; }
  void SetMisfit(double misfit) { misfit_ = misfit; }
  /// The fixes' errors are so many times, as a variance, what their covariances say.
  void SetScatter(double scatter) { scatter_ = scatter; }

  /// Mean square of a fix's pull, its whitened position error times its weight, when errors are
  /// Gaussian.
  [[nodiscard]] double ExpectedSquaredPull() const { return expected_squared_pull_; }

 private:
  double cauchy_scale_sigmas_;
  double correlation_time_s_;
  FixBias bias_;
  double correction_with_heading_;
  double correction_without_heading_;
  double expected_squared_pull_;
  double misfit_ = 1.0;
  double scatter_ = 1.0;
};

/// What is known of a keyframe from those before it.
struct KeyframePrior {
  PlanarPose pose;
  FixBiasEffect bias = {};  ///< Along W's axes, not part of the pose's covariance.
  CameraEffect camera = {};
};

/// A chain of keyframes with fixes on them, and what is known of its oldest from those before.
struct KeyframeWindow {
  SlidingVector<Keyframe> keyframes;
  SlidingVector<AttachedFix> fixes;               ///< By time.
  std::optional<KeyframePrior> prior;             ///< Of the oldest keyframe.
  CameraOffset camera;                            ///< Of all fixes.
  std::optional<MonotonicTime> last_removed_fix;  ///< The next one may be correlated with it.

  [[nodiscard]] bool Has(std::int64_t keyframe_id) const;
  [[nodiscard]] Keyframe& Get(std::int64_t keyframe_id);
  [[nodiscard]] const Keyframe& Get(std::int64_t keyframe_id) const;
  [[nodiscard]] Pose2 X_WF(const AttachedFix& fix) const;
  /// The first fix that is not of an older keyframe than this one.
  [[nodiscard]] AttachedFix* FirstFix(std::int64_t keyframe_id);

  /// Puts a fix in its place by time, and counts it with its keyframe.
  AttachedFix& Insert(AttachedFix fix);
  /// Moves the estimate of the camera's offset, the fixes and the prior with it.
  void SetCameraOffset(const Eigen::Vector2d& offset);
  /// Takes the oldest keyframe and its fixes out. The window must have two keyframes.
  void PopFront();
};

/// What is known of a keyframe where there is no prior: nothing, within the size of any map.
inline const Eigen::Vector3d kUnknownSigmas(1e4, 1e4, 10.0);

/// Sets the share of each fix that is news: fixes closer in time than they are independent share
/// the information of one, and those of one keyframe, one place, do not count as more than one.
///
/// Goes on from the fixes of the keyframe `first_id` to those of the next keyframe that has some,
/// as far as a change at `first_id` reaches. @return the id of the last one whose fixes it set.
std::int64_t UpdateShares(KeyframeWindow& window, double correlation_time_s, std::int64_t first_id);
/// The same for all fixes.
void UpdateAllShares(KeyframeWindow& window, double correlation_time_s);

}  // namespace relocd
