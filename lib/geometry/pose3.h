#pragma once

#include <ostream>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace relocd {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A rigid transform of space, an element of SE(3).
///
/// `Pose3 X_AB` is the pose of frame B in frame A: `p_AQ = X_AB * p_BQ` and `X_AC = X_AB * X_BC`.
/// Lengths in metres.
///
/// The tangent space is ordered (translation, rotation), perturbs on the right (X * Exp(delta)),
/// and follows J. Sola et al., "A micro Lie theory for state estimation in robotics", 2018, section
/// IV and appendix D.
class Pose3 {
 public:
  Pose3() = default;
  /// @param rotation  need not be of unit length, but must not be zero.
  Pose3(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation)
      : rotation_(rotation.normalized()), translation_(translation) {}
  Pose3(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation)
      : Pose3(Eigen::Quaterniond(rotation), translation) {}

  /// The pose reached with the constant body twist `tangent` in one unit of time.
  static Pose3 Exp(const Vector6d& tangent);

  /// The inverse of Exp, with a rotation of at most pi.
  [[nodiscard]] Vector6d Log() const;

  [[nodiscard]] Pose3 Inverse() const;

  /// The 6x6 matrix with `X * Exp(delta) == Exp(X.Adjoint() * delta) * X`.
  [[nodiscard]] Matrix6d Adjoint() const;

  [[nodiscard]] const Eigen::Quaterniond& rotation() const { return rotation_; }
  [[nodiscard]] Eigen::Matrix3d R() const { return rotation_.toRotationMatrix(); }
  [[nodiscard]] const Eigen::Vector3d& translation() const { return translation_; }

 private:
  Eigen::Quaterniond rotation_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation_ = Eigen::Vector3d::Zero();
};

Pose3 operator*(const Pose3& X_AB, const Pose3& X_BC);
Eigen::Vector3d operator*(const Pose3& X_AB, const Eigen::Vector3d& p_BQ);

/// The rotation by roll about x, then pitch about y, then yaw about z, all axes fixed: Rz(yaw)
/// Ry(pitch) Rx(roll).
Eigen::Matrix3d RotationFromRollPitchYaw(double roll_rad, double pitch_rad, double yaw_rad);

/// The angle between two rotations, in [0, pi].
double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

/// The 3x3 matrix with `Skew(a) * b == a.cross(b)`.
Eigen::Matrix3d Skew(const Eigen::Vector3d& vector);

std::ostream& operator<<(std::ostream& stream, const Pose3& pose);

}  // namespace relocd
