#pragma once

#include <optional>

#include <Eigen/Core>

#include "odometry/differential_drive.h"
#include "odometry/turn_sensors.h"

namespace relocd {

/// All that measured how a car moved over an interval.
struct CarMeasurement {
  WheelTravel rear{};
  bool uses_rear_difference = true;          ///< Whether the rear wheels tell the turn, too.
  std::optional<Eigen::Vector2d> front_m{};  ///< Travel of the left and the right front wheel.
  std::optional<double> steering_rad{};      ///< Of a front wheel in the middle.
  double steering_sigma_rad = 0.01;
  std::optional<TurnMeasurement> turn{};  ///< By a yaw-rate sensor.
};

/// How the body moved over it.
struct BodyTravel {
  double forward_m = 0.0;
  double turn_rad = 0.0;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< Of both, in m and rad.
  /// The measurement that agrees least with the others, in its standard deviations.
  double worst_residual = 0.0;
};

/// How far the body turned by the steering, if it went `forward_m`.
TurnMeasurement TurnBySteering(const DifferentialDriveConfig& drive,
                               const CarMeasurement& measured,
                               double forward_m);

/// The least squares of all measurements under the rolling condition: no wheel moves sideways, and
/// the rear axle's middle is the body's origin. Measurements further off than their noise explains
/// count less (Huber).
BodyTravel SolveCarTravel(const DifferentialDriveConfig& drive, const CarMeasurement& measured);

/// The motion of that travel, an arc of constant curvature, with what the config adds for sideways
/// travel, turning and time.
BodyMotion MotionFromBodyTravel(const DifferentialDriveConfig& drive,
                                const BodyTravel& travel,
                                double duration_s);

}  // namespace relocd
