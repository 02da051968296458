#include "smoothing/odometry_drift.h"

#include <algorithm>
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

Eigen::Vector2d AsVector(const MotionExtent& motion) {
  return {motion.way_m, motion.driven_s};
}

}  // namespace

OdometryDrift::OdometryDrift(const OdometryDriftPrior& prior)
    : prior_turn_covariance_(
          Eigen::Vector2d(prior.rad_per_m * prior.rad_per_m, prior.rad_per_s * prior.rad_per_s)
              .asDiagonal()),
      prior_scale_(prior.scale),
      turn_covariance_(prior_turn_covariance_),
      sigma_scale_(prior.scale) {}

double OdometryDrift::TurnOver(const MotionExtent& motion) const {
  return turn_.dot(AsVector(motion));
}

Pose2 OdometryDrift::Correct(const Pose2& X_AB, const MotionExtent& motion) {
  const double turn = TurnOver(motion);
  corrected_turn_rad_ += turn;
  corrected_way_m_ += scale_ * motion.way_m;
  const Eigen::Vector2d translation = (1.0 + scale_) * X_AB.translation();
  return {translation.x(), translation.y(), X_AB.yaw() + turn};
}

Eigen::Matrix3d OdometryDrift::Covariance(const MotionExtent& motion) const {
  // The errors of keyframes are independent in the chain, those of a drift are not: both grow to
  // the same over so many motions like this one, by which the fixes have said what the drift is.
  constexpr double kSameAfterM = 100.0;
  constexpr double kSameAfterS = 100.0;
  if (motion.way_m <= 0.0 && motion.driven_s <= 0.0) return Eigen::Matrix3d::Zero();
  const double motions = 1.0 / std::max(motion.way_m / kSameAfterM, motion.driven_s / kSameAfterS);
  const double forward = sigma_scale_ * motion.way_m;
  const double turn_variance = AsVector(motion).dot(turn_covariance_ * AsVector(motion));
  return motions * Eigen::Vector3d(forward * forward, 0.0, turn_variance).asDiagonal();
}

void OdometryDrift::CorrectAnew(const Keyframe& before, Keyframe& keyframe) const {
  const MotionExtent motion = keyframe.extent - before.extent;
  const double turn = TurnOver(motion) - (keyframe.corrected_turn_rad - before.corrected_turn_rad);
  const double way_m = scale_ * motion.way_m - (keyframe.corrected_way_m - before.corrected_way_m);
  const double stretch = motion.way_m > 0.0 ? way_m / motion.way_m : 0.0;
  // Half of the turn comes before the way, half after it.
  const Pose2 half(0.0, 0.0, 0.5 * turn);
  const Eigen::Vector2d translation = (1.0 + stretch) * keyframe.X_PK.translation();
  keyframe.X_PK = half * Pose2(translation.x(), translation.y(), keyframe.X_PK.yaw()) * half;
  const Eigen::Matrix3d covariance = Covariance(motion);
  keyframe.covariance_PK += covariance - keyframe.drift_covariance_PK;
  keyframe.drift_covariance_PK = covariance;
}

void OdometryDrift::Estimate(const KeyframeWindow& window, const Eigen::Matrix3d& covariance) {
  const Keyframe& oldest = window.keyframes.front();
  const Keyframe& newest = window.keyframes.back();
  const MotionExtent motion = newest.extent - oldest.extent;
  constexpr double kShortestWay = 10.0;  // a body that hardly moved tells nothing
  if (motion.way_m < kShortestWay) return;
  const Residuals residuals = SumResiduals(window);
  const double turn = newest.corrected_turn_rad - oldest.corrected_turn_rad + residuals.turn_rad;
  const double way = newest.corrected_way_m - oldest.corrected_way_m + residuals.way_m;
  // Both ends of the window are known no better than its newest keyframe, and the fixes there err
  // together: twice its sigmas each.
  const Eigen::Matrix3d variances = 2.0 * 4.0 * covariance;
  const Eigen::Vector2d turn_gain =
      prior_turn_covariance_ * AsVector(motion) /
      (AsVector(motion).dot(prior_turn_covariance_ * AsVector(motion)) + variances(2, 2));
  turn_ = turn_gain * turn;
  turn_covariance_ =
      prior_turn_covariance_ - turn_gain * AsVector(motion).transpose() * prior_turn_covariance_;
  const double prior_way_variance = std::pow(prior_scale_ * motion.way_m, 2);
  const double way_gain = prior_way_variance / (prior_way_variance + variances(0, 0));
  scale_ = way_gain * way / motion.way_m;
  sigma_scale_ = prior_scale_ * std::sqrt(1.0 - way_gain);
}

}  // namespace relocd
