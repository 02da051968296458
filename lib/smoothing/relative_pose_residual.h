#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "geometry/angle.h"
#include "geometry/pose2.h"

namespace relocd {

/// How far two poses are from a measured motion between them.
///
/// The error is (R_WA^T * (p_WB - p_WA) - p_AB, wrap(yaw_WB - yaw_WA - yaw_AB)), along A's axes;
/// its covariance is that of the measured X_AB's right perturbation, turned from the measured B's
/// axes to A's. A pose is (x, y, yaw), in m and rad; its yaw need not be wrapped.
class RelativePoseResidual {
 public:
  /// At one pair of poses: the error, and its derivatives.
  struct Linearization {
    Eigen::Vector3d error = Eigen::Vector3d::Zero();
    Eigen::Matrix3d by_A = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d by_B = Eigen::Matrix3d::Zero();  ///< A rotation by -yaw_WA.
  };

  RelativePoseResidual() = default;
  /// @param X_AB        the measured pose of B in A.
  /// @param covariance  3x3 of X_AB's right perturbation (x, y, yaw), positive definite.
  RelativePoseResidual(const Pose2& X_AB, const Eigen::Matrix3d& covariance) : X_AB_(X_AB) {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    rotation.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(X_AB.yaw()).toRotationMatrix();
    covariance_ = rotation * covariance * rotation.transpose();
  }

  [[nodiscard]] Linearization Linearize(const Eigen::Vector3d& x_WA,
                                        const Eigen::Vector3d& x_WB) const {
    const double cosine = std::cos(x_WA.z());
    const double sine = std::sin(x_WA.z());
    const double x = x_WB.x() - x_WA.x();
    const double y = x_WB.y() - x_WA.y();
    const Eigen::Vector2d p_AB(cosine * x + sine * y, -sine * x + cosine * y);
    Linearization result;
    result.by_B << cosine, sine, 0.0, -sine, cosine, 0.0, 0.0, 0.0, 1.0;
    result.by_A = -result.by_B;
    result.by_A.topRightCorner<2, 1>() << p_AB.y(), -p_AB.x();
    result.error << p_AB - X_AB_.translation(), WrapAngle(x_WB.z() - x_WA.z() - X_AB_.yaw());
    return result;
  }

  [[nodiscard]] const Eigen::Matrix3d& covariance() const { return covariance_; }

 private:
  Pose2 X_AB_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Identity();
};

}  // namespace relocd
