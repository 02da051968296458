#include "smoothing/systematic_errors.h"

namespace relocd {

Pose2 CorrectMotion(const Pose2& X_AB,
                    const MotionExtent& motion,
                    const MotionCorrection& correction) {
  const double stretch = motion.way_m > 0.0 ? correction.way_m / motion.way_m : 0.0;
  const Pose2 half(0.0, 0.0, 0.5 * correction.turn_rad);
  const Eigen::Vector2d translation = (1.0 + stretch) * X_AB.translation();
  return half * Pose2(translation.x(), translation.y(), X_AB.yaw()) * half;
}

ByOdometry MotionByOdometryErrors(const Pose2& X_AB, const MotionExtent& motion) {
  const Eigen::Vector3d by_turn(-0.5 * X_AB.y(), 0.5 * X_AB.x(), 1.0);
  ByOdometry by_errors;
  by_errors << X_AB.x(), 0.0, 0.0, X_AB.y(), 0.0, 0.0, 0.0, 0.0, 0.0;
  by_errors.col(1) = motion.way_m * by_turn;
  by_errors.col(2) = motion.driven_s * by_turn;
  return by_errors;
}

}  // namespace relocd
