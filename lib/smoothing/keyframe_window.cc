#include "smoothing/keyframe_window.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "core/check.h"

namespace relocd {
namespace {

/// The motion's covariance joins the fix's: it is small, and taken along the measured axes.
Eigen::Matrix3d TotalCovariance(const AttachedFix& fix) {
  if (fix.fix.has_heading) return fix.fix.covariance + fix.covariance_KB;
  Eigen::Matrix3d total = fix.fix.covariance;
  total.topLeftCorner<2, 2>() +=
      0.5 * fix.covariance_KB.topLeftCorner<2, 2>().trace() * Eigen::Matrix2d::Identity();
  return total;
}

/// The lower triangular root of the fix's own covariance, along W's axes.
Eigen::Matrix3d CovarianceRoot(const Fix& fix) {
  if (fix.has_heading) {
    const Eigen::Matrix3d rotation = Pose2(0.0, 0.0, fix.X_WB.yaw()).Adjoint();
    return (rotation * fix.covariance * rotation.transpose()).eval().llt().matrixL();
  }
  Eigen::Matrix3d root = Eigen::Matrix3d::Zero();
  root.topLeftCorner<2, 2>() = fix.covariance.topLeftCorner<2, 2>().eval().llt().matrixL();
  return root;
}

/// Means over Gaussian errors of `dimension`, s the squared length and w(s) the Cauchy weight.
struct KernelMeans {
  double weight = 0.0;        ///< w, what a reweighted least-squares problem shows.
  double slope = 0.0;         ///< w + 2 s w' / dimension, the pull's mean derivative.
  double squared_pull = 0.0;  ///< s w^2.
};

KernelMeans IntegrateKernel(double scale, int dimension) {
  constexpr double kStep = 0.01;
  constexpr double kEnd = 40.0;
  double mass = 0.0;
  KernelMeans sum;
  for (double r = 0.5 * kStep; r * r < kEnd; r += kStep) {
    const double s = r * r;
    const double density = std::pow(r, dimension - 1) * std::exp(-0.5 * s);
    const double weight = 1.0 / (1.0 + s / (scale * scale));
    mass += density;
    sum.weight += density * weight;
    sum.slope += density * (weight - 2.0 * s * weight * weight / (scale * scale * dimension));
    sum.squared_pull += density * s * weight * weight;
  }
  return {sum.weight / mass, sum.slope / mass, sum.squared_pull / mass};
}

/// The weights of good fixes are below one only for the kernel's sake: their information is that of
/// an M-estimator, (mean slope)^2 / (mean squared pull / dimension) (Huber, 1981, section 6).
double KernelCorrection(double scale, int dimension) {
  const KernelMeans means = IntegrateKernel(scale, dimension);
  return means.slope * means.slope * dimension / (means.squared_pull * means.weight);
}

/// Sets the shares of the fixes of one keyframe, those from `first` on.
///
/// @param last  the time of the fix before them, and then that of their last one.
/// @return the first fix of another keyframe.
AttachedFix* UpdateSharesOfOne(AttachedFix* first,
                               const AttachedFix* end,
                               double correlation_time_s,
                               std::optional<MonotonicTime>& last) {
  double sum = 0.0;
  AttachedFix* fix = first;
  for (; fix != end && fix->keyframe_id == first->keyframe_id; ++fix) {
    fix->share = 0.0;
    if (fix->is_gated) continue;
    const double gap_s = last ? ToSeconds(fix->fix.time - *last) : correlation_time_s;
    fix->share = gap_s >= correlation_time_s ? 1.0 : std::max(gap_s / correlation_time_s, 1e-3);
    sum += fix->share;
    last = fix->fix.time;
  }
  if (sum > 1.0) {
    for (AttachedFix* other = first; other != fix; ++other)
      other->share /= sum;
  }
  return fix;
}

}  // namespace

void Keyframe::CorrectMotionBy(const Eigen::Vector3d& odometry_errors) {
  const auto correction = MotionCorrection::Of(extent_PK, odometry_errors);
  X_PK = CorrectMotion(X_PK,
                       extent_PK,
                       {.way_m = correction.way_m - correction_PK.way_m,
                        .turn_rad = correction.turn_rad - correction_PK.turn_rad});
  correction_PK = correction;
}

Pose2 AttachedFix::MotionWith(const Eigen::Vector2d& camera_errors) const {
  const Eigen::Vector3d x_BF = X_BF_by_camera * camera_errors;
  return X_KB * Pose2(x_BF.x(), x_BF.y(), x_BF.z());
}

ByCamera AttachedFix::ErrorByCamera(double yaw_WK) const {
  const Eigen::Rotation2Dd R_WB(yaw_WK + X_KB.yaw());
  ByCamera by_camera = X_BF_by_camera;
  by_camera.topRows<2>() = R_WB * X_BF_by_camera.topRows<2>();
  return by_camera;
}

void PrepareResidual(AttachedFix& fix, const Eigen::Vector2d& camera_errors) {
  fix.X_KF = fix.MotionWith(camera_errors);
  const Eigen::Matrix3d covariance = TotalCovariance(fix);
  fix.covariance_root = CovarianceRoot(fix.fix);
  fix.residual = fix.fix.has_heading
                     ? AbsolutePoseResidual::OfPose(fix.fix.X_WB, fix.X_KF, covariance)
                     : AbsolutePoseResidual::OfPosition(
                           fix.fix.X_WB.translation(), fix.X_KF, covariance.topLeftCorner<2, 2>());
}

FixWeighting::FixWeighting(double cauchy_scale_sigmas,
                           double correlation_time_s,
                           const FixBias& bias)
    : cauchy_scale_sigmas_(cauchy_scale_sigmas),
      correlation_time_s_(correlation_time_s),
      bias_(bias),
      correction_with_heading_(KernelCorrection(cauchy_scale_sigmas, 3)),
      correction_without_heading_(KernelCorrection(cauchy_scale_sigmas, 2)),
      expected_squared_pull_(IntegrateKernel(cauchy_scale_sigmas, 2).squared_pull) {}

bool FixWeighting::SetScatter(double scatter) {
  constexpr double kLeastChange = 0.05;
  scatter_ = scatter;
  const double factor = std::sqrt(std::max(1.0, scatter));
  if (std::abs(factor / sigma_factor_ - 1.0) <= kLeastChange) return false;
  sigma_factor_ = factor;
  return true;
}

bool KeyframeWindow::Has(std::int64_t keyframe_id) const {
  return !keyframes.empty() && keyframe_id >= keyframes.front().id &&
         keyframe_id <= keyframes.back().id;
}

Keyframe& KeyframeWindow::Get(std::int64_t keyframe_id) {
  RELOCD_CHECK(Has(keyframe_id), "the keyframe is not in the window");
  return keyframes[static_cast<std::size_t>(keyframe_id - keyframes.front().id)];
}

const Keyframe& KeyframeWindow::Get(std::int64_t keyframe_id) const {
  RELOCD_CHECK(Has(keyframe_id), "the keyframe is not in the window");
  return keyframes[static_cast<std::size_t>(keyframe_id - keyframes.front().id)];
}

Pose2 KeyframeWindow::X_WF(const AttachedFix& fix) const {
  return Get(fix.keyframe_id).X_WK() * fix.X_KF;
}

AttachedFix* KeyframeWindow::FirstFix(std::int64_t keyframe_id) {
  return std::lower_bound(
      fixes.begin(), fixes.end(), keyframe_id, [](const AttachedFix& fix, std::int64_t id) {
        return fix.keyframe_id < id;
      });
}

AttachedFix& KeyframeWindow::Insert(AttachedFix fix) {
  Keyframe& keyframe = Get(fix.keyframe_id);
  ++(fix.is_gated ? keyframe.gated_fixes : keyframe.fixes);
  AttachedFix* const after = std::upper_bound(
      fixes.begin(), fixes.end(), fix.fix.time, [](MonotonicTime time, const AttachedFix& other) {
        return time < other.fix.time;
      });
  return *fixes.insert(after, std::move(fix));
}

void KeyframeWindow::SetSystematicErrors(const SystematicVector& errors) {
  const SystematicVector change = errors - systematic.estimate;
  systematic.estimate = errors;
  systematic.before_window.rhs -= systematic.before_window.information * change;
  if (!CameraPart(change).isZero(0.0)) {
    for (AttachedFix& fix : fixes)
      PrepareResidual(fix, CameraPart(errors));
  }
  for (Keyframe& keyframe : keyframes)
    keyframe.CorrectMotionBy(OdometryPart(errors));
  if (prior) prior->x_WK += prior->systematic.by_errors * change;
}

void KeyframeWindow::PopFront() {
  RELOCD_CHECK(keyframes.size() > 1, "the newest keyframe must stay");
  const std::int64_t id = keyframes.front().id;
  keyframes.pop_front();
  while (!fixes.empty() && fixes.front().keyframe_id <= id) {
    if (!fixes.front().is_gated) last_removed_fix = fixes.front().fix.time;
    fixes.pop_front();
  }
}

std::int64_t UpdateShares(KeyframeWindow& window,
                          double correlation_time_s,
                          std::int64_t first_id) {
  AttachedFix* fix = window.FirstFix(first_id);
  std::optional<MonotonicTime> last = window.last_removed_fix;
  for (const AttachedFix* before = fix; before != window.fixes.begin();) {
    --before;
    if (before->is_gated) continue;
    last = before->fix.time;
    break;
  }
  std::int64_t id = first_id;
  while (fix != window.fixes.end()) {
    id = fix->keyframe_id;
    fix = UpdateSharesOfOne(fix, window.fixes.end(), correlation_time_s, last);
    if (id > first_id && window.Get(id).fixes > 0) break;
  }
  return id;
}

void UpdateAllShares(KeyframeWindow& window, double correlation_time_s) {
  std::optional<MonotonicTime> last = window.last_removed_fix;
  for (AttachedFix* fix = window.fixes.begin(); fix != window.fixes.end();) {
    fix = UpdateSharesOfOne(fix, window.fixes.end(), correlation_time_s, last);
  }
}

}  // namespace relocd
