#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "relocd/camera_pose_t.hpp"

#include "geometry/pose3.h"

namespace relocd {

/// A fix of the camera `front` with usual sigmas, 0.1 m and 0.02 rad; the caller says when.
inline camera_pose_t CameraPoseMessage(const Pose3& X_WC) {
  camera_pose_t message{};
  message.camera = "front";
  message.map_id = "map";
  message.status = camera_pose_t::STATUS_OK;
  Eigen::Map<Eigen::Vector3d>(message.pos) = X_WC.translation();
  const Eigen::Quaterniond& q = X_WC.rotation();
  Eigen::Map<Eigen::Vector4d>(message.quat) << q.w(), q.vec();
  Vector6d sigmas;
  sigmas << 0.1, 0.1, 0.1, 0.02, 0.02, 0.02;
  Eigen::Map<Matrix6d>(message.covariance) = sigmas.cwiseAbs2().asDiagonal();
  return message;
}

}  // namespace relocd
