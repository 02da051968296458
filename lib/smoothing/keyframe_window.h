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
#include "smoothing/systematic_errors.h"

namespace relocd {

/// A pose that is estimated, and the composed odometry that leads to it.
struct Keyframe {
  std::int64_t id = 0;  ///< One more than the keyframe before.
  MonotonicTime time{};
  Pose2 X_OB;
  Eigen::Vector3d x_WK = Eigen::Vector3d::Zero();  ///< The estimate X_WK: x, y, unwrapped yaw.
  Pose2 X_PK;  ///< The motion from the keyframe before (P), put right by the systematic errors.
  Eigen::Matrix3d covariance_PK = Eigen::Matrix3d::Identity();
  MotionExtent extent_PK;
  MotionCorrection correction_PK;  ///< Already put into X_PK.
  /// How often the estimates had been started anew when this one was last estimated.
  std::int64_t generation = 0;
  int fixes = 0;        ///< That are attached to it and have influence.
  int gated_fixes = 0;  ///< That are attached to it and have none.
  bool is_cut =
      false;  ///< The body was carried here: the motion from the keyframe before is wrong.

  [[nodiscard]] Pose2 X_WK() const { return {x_WK.x(), x_WK.y(), x_WK.z()}; }
  void SetX_WK(const Pose2& X_WK) { x_WK << X_WK.translation(), X_WK.yaw(); }
  [[nodiscard]] RelativePoseResidual MotionResidual() const { return {X_PK, covariance_PK}; }
  /// Puts X_PK right by these errors of the odometry, in place of those it was put right by.
  void CorrectMotionBy(const Eigen::Vector3d& odometry_errors);
};

/// A fix at the place F, and the motion to F from the keyframe before it: that of the body B at the
/// fix's time, and what the camera's errors make of it.
struct AttachedFix {
  Fix fix;
  std::int64_t keyframe_id = 0;
  Pose2 X_KB;
  Eigen::Matrix3d covariance_KB = Eigen::Matrix3d::Zero();
  ByCamera X_BF_by_camera = ByCamera::Zero();  ///< X_BF = Pose2(this * the camera's errors).
  Pose2 X_KF;                                  ///< With the present estimate.
  bool is_provisional = false;  ///< To be attached anew when the odometry has gone on.
  bool is_gated = false;        ///< Kept, but without influence.
  double share = 0.0;           ///< Of it that is news, by UpdateShares.
  /// The lower triangular root of its own covariance along W's axes: what a bias of one is in it.
  Eigen::Matrix3d covariance_root = Eigen::Matrix3d::Zero();
  AbsolutePoseResidual residual;

  /// X_KF with other errors of the camera.
  [[nodiscard]] Pose2 MotionWith(const Eigen::Vector2d& camera_errors) const;
  /// The derivative of the residual's error by the camera's errors, where K looks to `yaw_WK`.
  [[nodiscard]] ByCamera ErrorByCamera(double yaw_WK) const;
};

/// Fills in `X_KF`, `residual` and `covariance_root` from the other members.
void PrepareResidual(AttachedFix& fix, const Eigen::Vector2d& camera_errors = {0.0, 0.0});

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

  /// The kernel's, in the fixes' own sigmas.
  [[nodiscard]] double KernelScale() const { return SigmaFactor() * cauchy_scale_sigmas_; }
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
    return UnitKernelWeight(squared_error / (sigma_factor_ * sigma_factor_));
  }
  /// The same where errors are as large as the fixes say.
  [[nodiscard]] double UnitKernelWeight(double squared_error) const {
    return 1.0 / (1.0 + squared_error / (cauchy_scale_sigmas_ * cauchy_scale_sigmas_));
  }
  /// All fixes tell so many times less than if they erred independently.
  [[nodiscard]] double misfit() const { return misfit_; }
  void SetMisfit(double misfit) { misfit_ = misfit; }
  /// The fixes' errors are so many times, as a variance, what their covariances say.
  ///
  /// @return whether the kernel's weights are others now, and so all fixes are to be linearised
  /// anew. It costs what many fixes do, so a twentieth of a sigma is no reason.
  bool SetScatter(double scatter);
  /// By so many times a fix's sigmas are to be taken for larger than it says.
  [[nodiscard]] double SigmaFactor() const { return sigma_factor_; }

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
  double sigma_factor_ = 1.0;
};

/// What is known of a keyframe from those before it.
struct KeyframePrior {
  /// x, y and yaw, of the same turn as the keyframe's estimate: while little is known of the yaw, a
  /// linear filter may have it half a turn away and more.
  Eigen::Vector3d x_WK = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< Of its right perturbation.
  FixBiasEffect bias = {};  ///< Along W's axes, not part of the pose's covariance.
  SystematicEffect systematic = {};

  /// That of a keyframe whose estimate is the pose.
  static KeyframePrior At(const PlanarPose& pose) {
    const Pose2& X_WK = pose.X_WB;
    return {.x_WK = {X_WK.x(), X_WK.y(), X_WK.yaw()}, .covariance = pose.covariance};
  }
  [[nodiscard]] Pose2 X_WK() const { return {x_WK.x(), x_WK.y(), x_WK.z()}; }
};

/// A chain of keyframes with fixes on them, and what is known of its oldest from those before.
struct KeyframeWindow {
  SlidingVector<Keyframe> keyframes;
  SlidingVector<AttachedFix> fixes;               ///< By time.
  std::optional<KeyframePrior> prior;             ///< Of the oldest keyframe.
  SystematicErrors systematic;                    ///< Of all fixes and motions.
  std::optional<MonotonicTime> last_removed_fix;  ///< The next one may be correlated with it.

  [[nodiscard]] bool Has(std::int64_t keyframe_id) const;
  [[nodiscard]] Keyframe& Get(std::int64_t keyframe_id);
  [[nodiscard]] const Keyframe& Get(std::int64_t keyframe_id) const;
  [[nodiscard]] Pose2 X_WF(const AttachedFix& fix) const;
  /// The first fix that is not of an older keyframe than this one.
  [[nodiscard]] AttachedFix* FirstFix(std::int64_t keyframe_id);

  /// Puts a fix in its place by time, and counts it with its keyframe.
  AttachedFix& Insert(AttachedFix fix);
  /// Puts all fixes and motions right by other systematic errors, and moves the prior with them.
  void SetSystematicErrors(const SystematicVector& errors);
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
