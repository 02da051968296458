#pragma once

#include <string>

#include <Eigen/Core>

#include "geometry/pose2.h"

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
};

/// What the camera and the odometry get wrong all the time alike, in this order:
/// - the camera looks so many radians farther to the left than the config says,
/// - its fixes' times are so many seconds late,
/// - the odometry misses such a part of the way (wheels that are larger than the config says),
/// - and of the turn so many radians on each metre (wheels that differ),
/// - and on each second while the body moves (the bias of a yaw-rate sensor).
using SystematicVector = Eigen::Matrix<double, 5, 1>;
using SystematicMatrix = Eigen::Matrix<double, 5, 5>;
/// The derivative of a planar tangent by all of them, by the camera's two, by the odometry's three.
using BySystematic = Eigen::Matrix<double, 3, 5>;
using ByCamera = Eigen::Matrix<double, 3, 2>;
using ByOdometry = Eigen::Matrix3d;

inline auto CameraPart(const SystematicVector& errors) {
  return errors.head<2>();
}
inline auto OdometryPart(const SystematicVector& errors) {
  return errors.tail<3>();
}

/// By how much a motion was put right.
struct MotionCorrection {
  double way_m = 0.0;
  double turn_rad = 0.0;

  /// That of a motion of such an extent. @param odometry  (scale, rad per m, rad per s)
  static MotionCorrection Of(const MotionExtent& motion, const Eigen::Vector3d& odometry) {
    return {odometry.x() * motion.way_m,
            odometry.y() * motion.way_m + odometry.z() * motion.driven_s};
  }
  MotionCorrection& operator+=(const MotionCorrection& more) {
    way_m += more.way_m;
    turn_rad += more.turn_rad;
    return *this;
  }
};

/// What keyframes say of the systematic errors: information * (errors - estimate) = rhs. Of the
/// rhs, a bias of the fixes makes a part, given here for a bias of sigma one.
struct SystematicKnowledge {
  SystematicMatrix information = SystematicMatrix::Zero();
  SystematicVector rhs = SystematicVector::Zero();
  SystematicMatrix bias_covariance = SystematicMatrix::Zero();
  Eigen::Matrix<double, 5, 3> bias_cross = Eigen::Matrix<double, 5, 3>::Zero();  ///< With the bias.
};

/// What the systematic errors do to an estimate, along W's axes, whose covariance is for known
/// ones.
struct SystematicEffect {
  BySystematic by_errors = BySystematic::Zero();
  /// Covariance of what the fixes' bias makes of the knowledge's rhs and of the estimate.
  Eigen::Matrix<double, 5, 3> bias_cross = Eigen::Matrix<double, 5, 3>::Zero();
};

/// Constants with Gaussian priors about zero. With several cameras theirs is what they have in
/// common.
struct SystematicErrors {
  SystematicVector prior_sigmas = SystematicVector::Zero();  ///< Of 0: it is not looked for.
  SystematicVector estimate = SystematicVector::Zero();      ///< With which all is put right.
  SystematicMatrix covariance = SystematicMatrix::Zero();
  SystematicKnowledge before_window = {};  ///< From the keyframes that have left it.

  [[nodiscard]] bool IsSought() const { return prior_sigmas.maxCoeff() > 0.0; }
  [[nodiscard]] bool IsCameraSought() const { return CameraPart(prior_sigmas).maxCoeff() > 0.0; }

  /// What is not known of them, standard deviations.
  [[nodiscard]] SystematicVector Sigmas() const { return covariance.diagonal().cwiseSqrt(); }

  [[nodiscard]] double camera_yaw_rad() const { return estimate[0]; }
  [[nodiscard]] double camera_time_s() const { return estimate[1]; }
  [[nodiscard]] double odometry_scale() const { return estimate[2]; }
  [[nodiscard]] double odometry_rad_per_m() const { return estimate[3]; }
  [[nodiscard]] double odometry_rad_per_s() const { return estimate[4]; }
};

/// Those that are looked for, in words, a line each for the odometry and the camera; empty where
/// none is.
std::string Describe(const SystematicErrors& errors);

/// A motion that is longer and turns more by a correction: half of the turn comes before the way,
/// half after it.
Pose2 CorrectMotion(const Pose2& X_AB,
                    const MotionExtent& motion,
                    const MotionCorrection& correction);

/// The derivative of CorrectMotion's translation and yaw by the odometry's errors, where they are
/// small.
ByOdometry MotionByOdometryErrors(const Pose2& X_AB, const MotionExtent& motion);

}  // namespace relocd
