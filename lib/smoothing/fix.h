#pragma once

#include <Eigen/Core>

#include "core/time.h"
#include "geometry/pose2.h"

namespace relocd {

/// A measurement of where the body was in the map.
struct Fix {
  MonotonicTime time{};
  Pose2 X_WB;  ///< Without a heading its yaw means nothing.
  bool has_heading = true;
  /// With a heading: 3x3 of X_WB's right perturbation (x, y, yaw), in m and rad. Without: the upper
  /// left 2x2 is that of the position, along W's axes.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  Eigen::Vector2d p_BC = Eigen::Vector2d::Zero();  ///< Of the camera that it is from.
};

}  // namespace relocd
