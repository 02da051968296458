#pragma once

#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <ceres/autodiff_cost_function.h>

#include "geometry/angle.h"
#include "geometry/pose2.h"

namespace relocd {

/// How far the pose of a keyframe K is from a measured pose of F, a place at a known motion from K,
/// in standard deviations.
///
/// With X_WF = X_WK * X_KF and the measurement X_WM, the residual is
/// S * (R_WM^T * (p_WF - p_WM), wrap(yaw_WF - yaw_WM)), with S^T * S the inverse of the covariance.
/// The parameter block is K's (x, y, yaw), in m and rad; the yaw need not be wrapped.
class AbsolutePoseResidual {
 public:
  using CostFunction = ceres::AutoDiffCostFunction<AbsolutePoseResidual, 3, 3>;

  /// @param covariance  3x3 of X_WM's right perturbation (x, y, yaw), positive definite.
  AbsolutePoseResidual(const Pose2& X_WM, const Pose2& X_KF, const Eigen::Matrix3d& covariance)
      : X_WM_(X_WM), X_KF_(X_KF), weight_(covariance.inverse().llt().matrixU()) {
    const Eigen::Matrix2d R_MW = Eigen::Rotation2Dd(-X_WM.yaw()).toRotationMatrix();
    weight_.leftCols<2>() = (weight_.leftCols<2>() * R_MW).eval();
  }

  template <typename T>
  bool operator()(const T* x_WK, T* residual) const {
    using Vector2 = Eigen::Matrix<T, 2, 1>;
    const Vector2 p_WK(x_WK[0], x_WK[1]);
    const Vector2 p_WF =
        p_WK + Eigen::Rotation2D<T>(x_WK[2]) * X_KF_.translation().cast<T>().eval();

    Eigen::Matrix<T, 3, 1> error;
    error << p_WF - X_WM_.translation().cast<T>(), WrapAngle(x_WK[2] + X_KF_.yaw() - X_WM_.yaw());
    Eigen::Map<Eigen::Matrix<T, 3, 1>> weighted(residual);
    weighted = weight_.cast<T>() * error;
    return true;
  }

 private:
  Pose2 X_WM_;
  Pose2 X_KF_;
  /// S, which is upper triangular (matrixL() would weight wrongly), after the rotation to M's axes.
  Eigen::Matrix3d weight_;
};

/// The same for a measured position without heading: S * (p_WF - p_WM), along W's axes.
class AbsolutePositionResidual {
 public:
  using CostFunction = ceres::AutoDiffCostFunction<AbsolutePositionResidual, 2, 3>;

  /// @param p_KF        F's position in K.
  /// @param covariance  2x2 of p_WM along W's axes, positive definite.
  AbsolutePositionResidual(Eigen::Vector2d p_WM,
                           Eigen::Vector2d p_KF,
                           const Eigen::Matrix2d& covariance)
      : p_WM_(std::move(p_WM)),
        p_KF_(std::move(p_KF)),
        sqrt_information_(covariance.inverse().llt().matrixU()) {}

  template <typename T>
  bool operator()(const T* x_WK, T* residual) const {
    using Vector2 = Eigen::Matrix<T, 2, 1>;
    const Vector2 p_WK(x_WK[0], x_WK[1]);
    const Vector2 p_WF = p_WK + Eigen::Rotation2D<T>(x_WK[2]) * p_KF_.cast<T>().eval();
    Eigen::Map<Vector2> weighted(residual);
    weighted = sqrt_information_.cast<T>() * (p_WF - p_WM_.cast<T>());
    return true;
  }

 private:
  Eigen::Vector2d p_WM_;
  Eigen::Vector2d p_KF_;
  Eigen::Matrix2d sqrt_information_;
};

}  // namespace relocd
