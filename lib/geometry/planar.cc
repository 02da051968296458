#include "geometry/planar.h"

#include <cmath>

namespace relocd {

Pose2 ProjectToPlane(const Pose3& X_WB) {
  const Eigen::Vector3d forward_W = X_WB.rotation() * Eigen::Vector3d::UnitX();
  return {X_WB.translation().x(), X_WB.translation().y(), std::atan2(forward_W.y(), forward_W.x())};
}

PlanarPose ProjectToPlane(const Pose3& X_WB, const Matrix6d& covariance) {
  const Pose2 planar = ProjectToPlane(X_WB);
  const Eigen::Matrix3d R_WB = X_WB.R();
  // Position: d p_W = R_WB * rho, seen along the planar body's own axes. Yaw: with f = R_WB * e_x
  // the forward axis, which R_WB * (theta x e_x) moves, d yaw = (f_x df_y - f_y df_x) / (f_x^2 +
  // f_y^2).
  Eigen::Matrix<double, 3, 6> jacobian = Eigen::Matrix<double, 3, 6>::Zero();
  const Eigen::Matrix2d R_BW = Eigen::Rotation2Dd(-planar.yaw()).toRotationMatrix();
  jacobian.topLeftCorner<2, 3>() = R_BW * R_WB.topRows<2>();
  const Eigen::Vector3d forward_W = R_WB.col(0);
  const Eigen::Matrix3d forward_by_rotation = -R_WB * Skew(Eigen::Vector3d::UnitX());
  const double squared = forward_W.head<2>().squaredNorm();
  jacobian.bottomRightCorner<1, 3>() =
      (forward_W.x() * forward_by_rotation.row(1) - forward_W.y() * forward_by_rotation.row(0)) /
      squared;
  return {.X_WB = planar, .covariance = jacobian * covariance * jacobian.transpose()};
}

Matrix6d TransportCovariance(const Matrix6d& covariance_WC, const Pose3& X_BC) {
  const Matrix6d adjoint = X_BC.Adjoint();
  return adjoint * covariance_WC * adjoint.transpose();
}

Pose3 LiftFromPlane(const Pose2& X_WB) {
  return {RotationFromRollPitchYaw(0.0, 0.0, X_WB.yaw()), {X_WB.x(), X_WB.y(), 0.0}};
}

}  // namespace relocd
