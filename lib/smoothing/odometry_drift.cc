#include "smoothing/odometry_drift.h"

#include <cmath>
#include <cstddef>

#include "geometry/angle.h"

namespace relocd {
namespace {

/// How far the estimates of all motions differ from the odometry.
struct Residuals {
  double turn_rad = 0.0;
  double way_m = 0.0;
};

Residuals SumResiduals(const KeyframeWindow& window) {
  Residuals sum;
  for (std::size_t i = 1; i < window.keyframes.size(); ++i) {
    const Keyframe& keyframe = window.keyframes[i];
    if (keyframe.is_cut) continue;
    const Pose2 X_PK = window.keyframes[i - 1].X_WK().Inverse() * keyframe.X_WK();
    sum.turn_rad += WrapAngle(X_PK.yaw() - keyframe.X_PK.yaw());
    const Eigen::Vector2d& odometry = keyframe.X_PK.translation();
    const double length = odometry.norm();
    if (length > 0.0) sum.way_m += (X_PK.translation() - odometry).dot(odometry) / length;
  }
  return sum;
}

/// The most likely value under a prior about zero, of which `measured` has the variance given.
double Shrink(double measured, double variance, double prior) {
  return prior > 0.0 ? measured * prior * prior / (prior * prior + variance) : 0.0;
}

/// How uncertain it is then.
double ShrunkSigma(double variance, double prior) {
  return prior > 0.0 ? prior * std::sqrt(variance / (prior * prior + variance)) : 0.0;
}

}  // namespace

Pose2 OdometryDrift::Correct(const Pose2& X_AB) {
  const double way = X_AB.translation().norm();
  corrected_turn_rad_ += rad_per_m_ * way;
  corrected_way_m_ += scale_ * way;
  const Eigen::Vector2d translation = (1.0 + scale_) * X_AB.translation();
  return {translation.x(), translation.y(), X_AB.yaw() + rad_per_m_ * way};
}

Eigen::Matrix3d OdometryDrift::Covariance(double way_m) const {
  // The errors of keyframes are independent in the chain, those of a drift are not: both grow to
  // the same over this way, by which the fixes have said what the drift is.
  constexpr double kSameAfterM = 100.0;
  const double scale = sigma_scale_ * sigma_scale_;
  return kSameAfterM * way_m *
         Eigen::Vector3d(scale, 0.0, sigma_rad_per_m_ * sigma_rad_per_m_).asDiagonal();
}

void OdometryDrift::CorrectAnew(const Keyframe& before, Keyframe& keyframe) const {
  const double way = keyframe.odometer_m - before.odometer_m;
  if (way <= 0.0) return;
  const double turn = rad_per_m_ * way - (keyframe.corrected_turn_rad - before.corrected_turn_rad);
  const double stretch = scale_ - (keyframe.corrected_way_m - before.corrected_way_m) / way;
  // Half of the turn comes before the way, half after it.
  const Pose2 half(0.0, 0.0, 0.5 * turn);
  const Eigen::Vector2d translation = (1.0 + stretch) * keyframe.X_PK.translation();
  keyframe.X_PK = half * Pose2(translation.x(), translation.y(), keyframe.X_PK.yaw()) * half;
  keyframe.covariance_PK += Covariance(way) - keyframe.drift_covariance_PK;
  keyframe.drift_covariance_PK = Covariance(way);
}

void OdometryDrift::Estimate(const KeyframeWindow& window, const Eigen::Matrix3d& covariance) {
  const Keyframe& oldest = window.keyframes.front();
  const Keyframe& newest = window.keyframes.back();
  const double way_m = newest.odometer_m - oldest.odometer_m;
  constexpr double kShortestWay = 10.0;  // a body that hardly moved tells nothing
  if (way_m < kShortestWay) return;
  const Residuals residuals = SumResiduals(window);
  const double turn = newest.corrected_turn_rad - oldest.corrected_turn_rad + residuals.turn_rad;
  const double way = newest.corrected_way_m - oldest.corrected_way_m + residuals.way_m;
  // Both ends of the window are known no better than its newest keyframe, and the fixes there err
  // together: twice its sigmas each.
  const Eigen::Matrix3d variances = 2.0 * 4.0 / (way_m * way_m) * covariance;
  rad_per_m_ = Shrink(turn / way_m, variances(2, 2), prior_rad_per_m_);
  scale_ = Shrink(way / way_m, variances(0, 0), prior_scale_);
  sigma_rad_per_m_ = ShrunkSigma(variances(2, 2), prior_rad_per_m_);
  sigma_scale_ = ShrunkSigma(variances(0, 0), prior_scale_);
}

}  // namespace relocd
