#include "geometry/pose3.h"

#include <cmath>

namespace relocd {
namespace {

/// Below this angle the closed forms lose more digits to cancellation than their series drop.
constexpr double kSmallAngle = 1e-4;

Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& rotation) {
  const double angle = rotation.norm();
  const double half_sinc =
      angle < kSmallAngle ? 0.5 - angle * angle / 48.0 : std::sin(0.5 * angle) / angle;
  Eigen::Quaterniond q;
  q.w() = std::cos(0.5 * angle);
  q.vec() = half_sinc * rotation;
  return q;
}

Eigen::Vector3d LogRotation(Eigen::Quaterniond q) {
  if (q.w() < 0.0) q.coeffs() *= -1.0;
  const double sine = q.vec().norm();
  const double angle = 2.0 * std::atan2(sine, q.w());
  const double scale = sine < kSmallAngle ? 2.0 + angle * angle / 12.0 : angle / sine;
  return scale * q.vec();
}

/// Sola et al. (2018), equation (174): the translation of Exp is V * rho.
Eigen::Matrix3d ExpTranslationMatrix(const Eigen::Vector3d& rotation) {
  const double angle = rotation.norm();
  const double squared = angle * angle;
  const bool small = angle < kSmallAngle;
  const double a = small ? 0.5 - squared / 24.0 : (1.0 - std::cos(angle)) / squared;
  const double b =
      small ? 1.0 / 6.0 - squared / 120.0 : (angle - std::sin(angle)) / (squared * angle);
  const Eigen::Matrix3d skew = Skew(rotation);
  return Eigen::Matrix3d::Identity() + a * skew + b * skew * skew;
}

}  // namespace

Pose3 Pose3::Exp(const Vector6d& tangent) {
  const Eigen::Vector3d rotation = tangent.tail<3>();
  return {ExpRotation(rotation), ExpTranslationMatrix(rotation) * tangent.head<3>()};
}

Vector6d Pose3::Log() const {
  Vector6d tangent;
  tangent.tail<3>() = LogRotation(rotation_);
  tangent.head<3>() = ExpTranslationMatrix(tangent.tail<3>()).inverse() * translation_;
  return tangent;
}

Pose3 Pose3::Inverse() const {
  const Eigen::Quaterniond inverse = rotation_.conjugate();
  return {inverse, -(inverse * translation_)};
}

Matrix6d Pose3::Adjoint() const {
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = R();
  adjoint.bottomRightCorner<3, 3>() = R();
  adjoint.topRightCorner<3, 3>() = Skew(translation_) * R();
  return adjoint;
}

Pose3 operator*(const Pose3& X_AB, const Pose3& X_BC) {
  return {X_AB.rotation() * X_BC.rotation(), X_AB * X_BC.translation()};
}

Eigen::Vector3d operator*(const Pose3& X_AB, const Eigen::Vector3d& p_BQ) {
  return X_AB.rotation() * p_BQ + X_AB.translation();
}

Eigen::Matrix3d RotationFromRollPitchYaw(double roll_rad, double pitch_rad, double yaw_rad) {
  return (Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return a.angularDistance(b);
}

Eigen::Matrix3d Skew(const Eigen::Vector3d& vector) {
  return (Eigen::Matrix3d() << 0.0,
          -vector.z(),
          vector.y(),  //
          vector.z(),
          0.0,
          -vector.x(),  //
          -vector.y(),
          vector.x(),
          0.0)
      .finished();
}

std::ostream& operator<<(std::ostream& stream, const Pose3& pose) {
  return stream << "(p " << pose.translation().transpose() << " m, q (w x y z) "
                << pose.rotation().w() << " " << pose.rotation().vec().transpose() << ")";
}

}  // namespace relocd
