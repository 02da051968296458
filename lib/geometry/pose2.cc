#include "geometry/pose2.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "geometry/angle.h"

namespace relocd {
namespace {

/// Below this angle the closed forms lose more digits to cancellation than their series drop.
constexpr double kSmallAngle = 1e-5;

/// sin(angle) / angle.
double Sinc(double angle) {
  return std::abs(angle) < kSmallAngle ? 1.0 - angle * angle / 6.0 : std::sin(angle) / angle;
}

/// (1 - cos(angle)) / angle.
double Cosc(double angle) {
  return std::abs(angle) < kSmallAngle ? angle / 2.0 : (1.0 - std::cos(angle)) / angle;
}

/// The matrix V of Sola et al. (2018), equation (158): the translation of Exp is V * (x, y).
Eigen::Matrix2d ExpTranslationMatrix(double yaw) {
  return (Eigen::Matrix2d() << Sinc(yaw), -Cosc(yaw), Cosc(yaw), Sinc(yaw)).finished();
}

}  // namespace

Pose2::Pose2(double x_m, double y_m, double yaw_rad)
    : translation_(x_m, y_m), yaw_(WrapAngle(yaw_rad)) {}

Pose2 Pose2::Exp(const Eigen::Vector3d& tangent) {
  const double yaw = tangent.z();
  const Eigen::Vector2d translation = ExpTranslationMatrix(yaw) * tangent.head<2>();
  return {translation.x(), translation.y(), yaw};
}

Eigen::Vector3d Pose2::Log() const {
  Eigen::Vector3d tangent;
  tangent.head<2>() = ExpTranslationMatrix(yaw_).inverse() * translation_;
  tangent.z() = yaw_;
  return tangent;
}

Pose2 Pose2::Inverse() const {
  const Eigen::Vector2d translation = Eigen::Rotation2Dd(-yaw_) * -translation_;
  return {translation.x(), translation.y(), -yaw_};
}

Eigen::Matrix3d Pose2::Adjoint() const {
  Eigen::Matrix3d adjoint = Eigen::Matrix3d::Identity();
  adjoint.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(yaw_).toRotationMatrix();
  adjoint(0, 2) = y();
  adjoint(1, 2) = -x();
  return adjoint;
}

Pose2 operator*(const Pose2& X_AB, const Pose2& X_BC) {
  const Eigen::Vector2d p_AC = X_AB * X_BC.translation();
  return {p_AC.x(), p_AC.y(), X_AB.yaw() + X_BC.yaw()};
}

Eigen::Vector2d operator*(const Pose2& X_AB, const Eigen::Vector2d& p_BQ) {
  return Eigen::Rotation2Dd(X_AB.yaw()) * p_BQ + X_AB.translation();
}

std::ostream& operator<<(std::ostream& stream, const Pose2& pose) {
  return stream << "(x " << pose.x() << " m, y " << pose.y() << " m, yaw "
                << pose.yaw() * 180.0 / std::numbers::pi << " deg)";
}

}  // namespace relocd
