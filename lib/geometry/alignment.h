#pragma once

#include <span>

#include <Eigen/Core>

#include "core/result.h"
#include "geometry/pose2.h"
#include "geometry/pose3.h"

namespace relocd {

/// The rigid transform, without scale, for which the sum of |p_APs[i] - X_AB * p_BPs[i]|^2 is
/// least: S. Umeyama, "Least-squares estimation of transformation parameters between two point
/// patterns", 1991, equations (40) to (42) with c = 1.
///
/// @return kInvalidInput when the points are not as many, or do not determine the rotation: fewer
/// than two places in the plane, all on one line in space.
Result<Pose2> AlignPoints(std::span<const Eigen::Vector2d> p_APs,
                          std::span<const Eigen::Vector2d> p_BPs);
Result<Pose3> AlignPoints(std::span<const Eigen::Vector3d> p_APs,
                          std::span<const Eigen::Vector3d> p_BPs);

}  // namespace relocd
