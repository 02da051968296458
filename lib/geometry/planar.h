#pragma once

#include <Eigen/Core>

#include "geometry/pose2.h"
#include "geometry/pose3.h"

namespace relocd {

/// A pose in the plane, and the covariance of its right perturbation (x, y, yaw), in m and rad.
struct PlanarPose {
  Pose2 X_WB;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// The part in the ground plane of a pose whose frame W has z up: where B's origin stands, and
/// where its x axis points.
Pose2 ProjectToPlane(const Pose3& X_WB);

/// The same with the covariance, to first order.
///
/// @param covariance  6x6 of the right perturbation (translation, rotation) of X_WB.
PlanarPose ProjectToPlane(const Pose3& X_WB, const Matrix6d& covariance);

/// The covariance of the body's pose from that of the camera's, both 6x6 of right perturbations:
/// with X_WB = X_WC * X_CB, the perturbation of X_WB is Adjoint(X_BC) times that of X_WC.
Matrix6d TransportCovariance(const Matrix6d& covariance_WC, const Pose3& X_BC);

/// The pose in space of a body that stands on the plane z = 0.
Pose3 LiftFromPlane(const Pose2& X_WB);

}  // namespace relocd
