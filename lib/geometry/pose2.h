#pragma once

#include <ostream>

#include <Eigen/Core>

namespace relocd {

/// A rigid transform of the plane, an element of SE(2).
///
/// `Pose2 X_AB` is the pose of frame B in frame A, and takes coordinates in B to coordinates in A:
/// `p_AQ = X_AB * p_BQ` and `X_AC = X_AB * X_BC`. Lengths are in metres and angles in radians.
///
/// The tangent space is ordered (x, y, yaw), perturbs on the right (X * Exp(delta)), and follows
/// J. Sola et al., "A micro Lie theory for state estimation in robotics", 2018, section IV.
class Pose2 {
 public:
  Pose2() = default;
  Pose2(double x_m, double y_m, double yaw_rad);

  /// The pose reached by moving from the identity with the constant body twist `tangent` for one
  /// unit of time: an arc, and for a yaw rate of zero a straight line.
  static Pose2 Exp(const Eigen::Vector3d& tangent);

  /// The inverse of Exp, with the yaw in [-pi, pi).
  [[nodiscard]] Eigen::Vector3d Log() const;

  /// `X_BA`, for this `X_AB`.
  [[nodiscard]] Pose2 Inverse() const;

  /// The 3x3 matrix with `X * Exp(delta) == Exp(X.Adjoint() * delta) * X`.
  [[nodiscard]] Eigen::Matrix3d Adjoint() const;

  [[nodiscard]] const Eigen::Vector2d& translation() const { return translation_; }
  [[nodiscard]] double x() const { return translation_.x(); }
  [[nodiscard]] double y() const { return translation_.y(); }
  [[nodiscard]] double yaw() const { return yaw_; }  ///< In [-pi, pi).

 private:
  Eigen::Vector2d translation_ = Eigen::Vector2d::Zero();
  double yaw_ = 0.0;
};

Pose2 operator*(const Pose2& X_AB, const Pose2& X_BC);
Eigen::Vector2d operator*(const Pose2& X_AB, const Eigen::Vector2d& p_BQ);

/// For test failures and logs: `(x 1.5 m, y 0 m, yaw 90 deg)`.
std::ostream& operator<<(std::ostream& stream, const Pose2& pose);

}  // namespace relocd
