#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <ceres/autodiff_cost_function.h>

#include "geometry/angle.h"
#include "geometry/pose2.h"

namespace relocd {

/// How far two poses are from a measured motion between them, in standard deviations.
///
/// The residual is S * (R_AB^T * (R_WA^T * (p_WB - p_WA) - p_AB), wrap(yaw_WB - yaw_WA - yaw_AB)),
/// with S^T * S the inverse of the measurement's covariance: the error is expressed along the
/// measured B's axes, as the covariance of a right perturbation is. A parameter block is (x, y,
/// yaw), in m and rad; the yaw need not be wrapped.
class RelativePoseResidual {
 public:
  using CostFunction = ceres::AutoDiffCostFunction<RelativePoseResidual, 3, 3, 3>;

  /// @param X_AB        the measured pose of B in A.
  /// @param covariance  3x3 of X_AB's right perturbation (x, y, yaw), positive definite.
  RelativePoseResidual(const Pose2& X_AB, const Eigen::Matrix3d& covariance)
      : X_AB_(X_AB), weight_(covariance.inverse().llt().matrixU()) {
    const Eigen::Matrix2d R_BA = Eigen::Rotation2Dd(-X_AB.yaw()).toRotationMatrix();
    weight_.leftCols<2>() = (weight_.leftCols<2>() * R_BA).eval();
  }

  template <typename T>
  bool operator()(const T* x_WA, const T* x_WB, T* residual) const {
    using Vector2 = Eigen::Matrix<T, 2, 1>;
    const Vector2 p_WA(x_WA[0], x_WA[1]);
    const Vector2 p_WB(x_WB[0], x_WB[1]);
    const Vector2 p_AB = Eigen::Rotation2D<T>(-x_WA[2]) * Vector2(p_WB - p_WA);

    Eigen::Matrix<T, 3, 1> error;
    error << p_AB - X_AB_.translation().cast<T>(), WrapAngle(x_WB[2] - x_WA[2] - X_AB_.yaw());
    Eigen::Map<Eigen::Matrix<T, 3, 1>> weighted(residual);
    weighted = weight_.cast<T>() * error;
    return true;
  }

 private:
  Pose2 X_AB_;
  /// S, which is upper triangular (matrixL() would weight wrongly), after the rotation to B's axes.
  Eigen::Matrix3d weight_;
};

}  // namespace relocd
