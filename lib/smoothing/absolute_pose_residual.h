#pragma once

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "geometry/angle.h"
#include "geometry/pose2.h"

namespace relocd {

/// How far the pose of a keyframe K is from a measurement of F, a place at a known motion from K.
///
/// With X_WF = X_WK * X_KF and the measurement X_WM, the error is
/// (p_WF - p_WM, wrap(yaw_WF - yaw_WM)) along W's axes. It is weighted by an information matrix:
/// the inverse of the covariance, in which a measurement without heading says nothing of the yaw. A
/// pose is (x, y, yaw), in m and rad; its yaw need not be wrapped.
class AbsolutePoseResidual {
 public:
  /// At one pose of K: the error, and its derivative.
  struct Linearization {
    Eigen::Vector3d error;
    Eigen::Matrix3d by_K;
  };

  AbsolutePoseResidual() = default;

  /// @param covariance  3x3 of X_WM's right perturbation (x, y, yaw), positive definite.
  static AbsolutePoseResidual OfPose(const Pose2& X_WM,
                                     const Pose2& X_KF,
                                     const Eigen::Matrix3d& covariance) {
    AbsolutePoseResidual residual(X_WM, X_KF);
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    rotation.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(X_WM.yaw()).toRotationMatrix();
    residual.information_ = rotation * covariance.inverse() * rotation.transpose();
    return residual;
  }

  /// @param covariance  2x2 of p_WM along W's axes, positive definite.
  static AbsolutePoseResidual OfPosition(const Eigen::Vector2d& p_WM,
                                         const Pose2& X_KF,
                                         const Eigen::Matrix2d& covariance) {
    AbsolutePoseResidual residual(Pose2(p_WM.x(), p_WM.y(), 0.0), X_KF);
    residual.information_.topLeftCorner<2, 2>() = covariance.inverse();
    return residual;
  }

  /// The same measurement of another place.
  [[nodiscard]] AbsolutePoseResidual At(const Pose2& X_KF) const {
    AbsolutePoseResidual residual = *this;
    residual.X_KF_ = X_KF;
    return residual;
  }

  [[nodiscard]] Linearization Linearize(const Eigen::Vector3d& x_WK) const {
    const double cosine = std::cos(x_WK.z());
    const double sine = std::sin(x_WK.z());
    const Eigen::Vector2d arm_W(cosine * X_KF_.x() - sine * X_KF_.y(),
                                sine * X_KF_.x() + cosine * X_KF_.y());
    Linearization result;
    result.error << x_WK.head<2>() + arm_W - X_WM_.translation(),
        WrapAngle(x_WK.z() + X_KF_.yaw() - X_WM_.yaw());
    result.by_K << 1.0, 0.0, -arm_W.y(), 0.0, 1.0, arm_W.x(), 0.0, 0.0, 1.0;
    return result;
  }

  [[nodiscard]] const Eigen::Matrix3d& information() const { return information_; }

 private:
  AbsolutePoseResidual(const Pose2& X_WM, const Pose2& X_KF) : X_WM_(X_WM), X_KF_(X_KF) {}

  Pose2 X_WM_;
  Pose2 X_KF_;
  Eigen::Matrix3d information_ = Eigen::Matrix3d::Zero();
};

}  // namespace relocd
