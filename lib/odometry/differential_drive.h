#pragma once

#include <optional>

#include <Eigen/Core>

#include "core/result.h"
#include "geometry/pose2.h"

namespace relocd {

/// The geometry of two driven wheels on one axle, and how well they measure. A car's rear axle is
/// such a drive, too.
struct DifferentialDriveConfig {
  double left_radius_m = 0.1;
  double right_radius_m = 0.1;
  double left_scale = 1.0;
  double right_scale = 1.0;
  double front_left_scale = 1.0;
  double front_right_scale = 1.0;
  double track_m = 0.5;
  double wheelbase_m = 2.7;
  int ticks_per_revolution = 4096;
  double wheel_sigma_m_per_sqrt_m = 0.01;
  double lateral_sigma_m_per_sqrt_m = 0.005;
  double turn_sigma_rad_per_sqrt_rad = 0.02;
  double idle_sigma_m_per_sqrt_s = 1e-4;
  double idle_sigma_rad_per_sqrt_s = 1e-4;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("left_radius_m", self.left_radius_m, "> 0; of the wheel, for ticks");
    visit("right_radius_m", self.right_radius_m, "> 0; of the wheel, for ticks");
    visit("left_scale",
          self.left_scale,
          "not 0; corrects the wheel's travel, negative if it counts backwards");
    visit("right_scale",
          self.right_scale,
          "not 0; corrects the wheel's travel, negative if it counts backwards");
    visit("front_left_scale", self.front_left_scale, "not 0; the same of a car's front wheel");
    visit("front_right_scale", self.front_right_scale, "not 0; the same of a car's front wheel");
    visit("track_m", self.track_m, "> 0; between the wheels' contact points");
    visit("wheelbase_m", self.wheelbase_m, "> 0; a car's, from the rear to the front axle");
    visit("ticks_per_revolution", self.ticks_per_revolution, ">= 1; of the wheel, for ticks");
    visit("wheel_sigma_m_per_sqrt_m",
          self.wheel_sigma_m_per_sqrt_m,
          "> 0; noise of a wheel's travel after one metre");
    visit("lateral_sigma_m_per_sqrt_m",
          self.lateral_sigma_m_per_sqrt_m,
          "> 0; sideways drift after one metre");
    visit("turn_sigma_rad_per_sqrt_rad",
          self.turn_sigma_rad_per_sqrt_rad,
          ">= 0; more noise of the heading after turning by one rad");
    visit("idle_sigma_m_per_sqrt_s",
          self.idle_sigma_m_per_sqrt_s,
          "> 0; noise of the position after one second, also when standing");
    visit("idle_sigma_rad_per_sqrt_s",
          self.idle_sigma_rad_per_sqrt_s,
          "> 0; noise of the heading after one second, also when standing");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// What the wheels did over an interval.
struct WheelTravel {
  Eigen::Vector2d travel_m = Eigen::Vector2d::Zero();  ///< Of the left and the right wheel.
  /// Of each wheel's travel, in m^2, besides the config's: quantisation, or a guess over a gap.
  Eigen::Vector2d variance_m2 = Eigen::Vector2d::Zero();
  double duration_s = 0.0;
  std::optional<Eigen::Vector2d> front_m{};  ///< Of a car's front wheels, if they are measured.
};

/// A motion of the body from Bi to Bj, and the covariance of its right perturbation.
struct BodyMotion {
  Pose2 X_BiBj;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< Of (x, y, yaw), in m and rad.
};

/// The motion that the wheels' travel makes, taken to be an arc of constant curvature. The body's
/// origin is between the wheels.
///
/// The covariance is that of two independent wheels and of what the config adds for sideways
/// travel, turning and time, to first order.
BodyMotion MotionFromTravel(const DifferentialDriveConfig& config, const WheelTravel& travel);

/// The motion of a tangent (x, y, yaw) with this covariance, to which is added what the config has
/// for sideways travel, turning and time, to first order.
BodyMotion MotionFromTwist(const DifferentialDriveConfig& config,
                           const Eigen::Vector3d& tangent,
                           const Eigen::Matrix3d& covariance,
                           double duration_s);

/// The twist (x, y, yaw) of the body from what the left and the right wheel travel, or from their
/// speeds.
Eigen::Vector3d BodyTwist(double track_m, const Eigen::Vector2d& wheels);

/// The matrix J with Exp(t + d) = Exp(t) * Exp(J * d) to first order: Sola et al. (2018), equation
/// (163).
Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& tangent);

}  // namespace relocd
