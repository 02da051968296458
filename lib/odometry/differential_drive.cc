#include "odometry/differential_drive.h"

#include <cmath>

#include <fmt/format.h>

namespace relocd {
namespace {

Error Invalid(const char* name, double value, const char* allowed) {
  return {ErrorKind::kInvalidInput, fmt::format("{} is {}, must be {}", name, value, allowed)};
}

/// (x, y, yaw) of the body from the travel of the left and the right wheel.
Eigen::Matrix<double, 3, 2> BodyFromWheels(double track_m) {
  Eigen::Matrix<double, 3, 2> body_from_wheels;
  body_from_wheels << 0.5, 0.5,  //
      0.0, 0.0,                  //
      -1.0 / track_m, 1.0 / track_m;
  return body_from_wheels;
}

double Square(double value) {
  return value * value;
}

}  // namespace

Result<void> DifferentialDriveConfig::Validate() const {
  struct Field {
    const char* name;
    double value;
  };
  // `!(value > 0)` is also true of NaN.
  for (const Field& field : {Field{"left_radius_m", left_radius_m},
                             Field{"right_radius_m", right_radius_m},
                             Field{"track_m", track_m},
                             Field{"wheelbase_m", wheelbase_m},
                             Field{"wheel_sigma_m_per_sqrt_m", wheel_sigma_m_per_sqrt_m},
                             Field{"lateral_sigma_m_per_sqrt_m", lateral_sigma_m_per_sqrt_m},
                             Field{"idle_sigma_m_per_sqrt_s", idle_sigma_m_per_sqrt_s},
                             Field{"idle_sigma_rad_per_sqrt_s", idle_sigma_rad_per_sqrt_s}}) {
    if (!(field.value > 0.0) || !std::isfinite(field.value)) {
      return Invalid(field.name, field.value, "positive and finite");
    }
  }
  for (const Field& field : {Field{"left_scale", left_scale},
                             Field{"right_scale", right_scale},
                             Field{"front_left_scale", front_left_scale},
                             Field{"front_right_scale", front_right_scale}}) {
    if (field.value == 0.0 || !std::isfinite(field.value)) {
      return Invalid(field.name, field.value, "finite and not 0");
    }
  }
  if (!(turn_sigma_rad_per_sqrt_rad >= 0.0) || !std::isfinite(turn_sigma_rad_per_sqrt_rad)) {
    return Invalid(
        "turn_sigma_rad_per_sqrt_rad", turn_sigma_rad_per_sqrt_rad, "at least 0 and finite");
  }
  if (ticks_per_revolution < 1) {
    return Invalid("ticks_per_revolution", ticks_per_revolution, "at least 1");
  }
  return {};
}

Eigen::Vector3d BodyTwist(double track_m, const Eigen::Vector2d& wheels) {
  return BodyFromWheels(track_m) * wheels;
}

Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& tangent) {
  const double x = tangent.x();
  const double y = tangent.y();
  const double yaw = tangent.z();
  // Below this angle the closed forms lose more digits to cancellation than their series drop.
  constexpr double kSmallAngle = 1e-4;
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Identity();
  if (std::abs(yaw) < kSmallAngle) {
    jacobian << 1.0, yaw / 2.0, -y / 2.0 + x * yaw / 6.0,  //
        -yaw / 2.0, 1.0, x / 2.0 + y * yaw / 6.0,          //
        0.0, 0.0, 1.0;
    return jacobian;
  }
  const double sine = std::sin(yaw);
  const double cosine = std::cos(yaw);
  jacobian << sine / yaw, (1.0 - cosine) / yaw, (yaw * x - y + y * cosine - x * sine) / (yaw * yaw),
      (cosine - 1.0) / yaw, sine / yaw, (x + yaw * y - x * cosine - y * sine) / (yaw * yaw),  //
      0.0, 0.0, 1.0;
  return jacobian;
}

BodyMotion MotionFromTwist(const DifferentialDriveConfig& config,
                           const Eigen::Vector3d& tangent,
                           const Eigen::Matrix3d& covariance,
                           double duration_s) {
  Eigen::Matrix3d sum = covariance;
  const double idle_m2 = Square(config.idle_sigma_m_per_sqrt_s) * duration_s;
  sum(0, 0) += idle_m2;
  sum(1, 1) += idle_m2 + Square(config.lateral_sigma_m_per_sqrt_m) * std::abs(tangent.x());
  sum(2, 2) += Square(config.idle_sigma_rad_per_sqrt_s) * duration_s +
               Square(config.turn_sigma_rad_per_sqrt_rad) * std::abs(tangent.z());
  const Eigen::Matrix3d jacobian = RightJacobian(tangent);
  return {.X_BiBj = Pose2::Exp(tangent), .covariance = jacobian * sum * jacobian.transpose()};
}

BodyMotion MotionFromTravel(const DifferentialDriveConfig& config, const WheelTravel& travel) {
  const Eigen::Matrix<double, 3, 2> body_from_wheels = BodyFromWheels(config.track_m);
  const Eigen::Vector3d tangent = body_from_wheels * travel.travel_m;
  const Eigen::Vector2d wheel_variance =
      Square(config.wheel_sigma_m_per_sqrt_m) * travel.travel_m.cwiseAbs() + travel.variance_m2;
  const Eigen::Matrix3d covariance =
      body_from_wheels * wheel_variance.asDiagonal() * body_from_wheels.transpose();
  return MotionFromTwist(config, tangent, covariance, travel.duration_s);
}

}  // namespace relocd
