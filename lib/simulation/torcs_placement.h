#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "simulation/torcs_layout.h"

namespace relocd {

/// Where the described track lies in its mesh, whose axes are parallel to the description's: the
/// origin of T in W. It is the place at which most of the road's edge points meet vertices.
///
/// @param vertices_W  of the mesh.
/// @return kInvalidInput when less than nine tenths of the points meet one within 0.3 m.
Result<Eigen::Vector3d> FindTrackInMesh(const TorcsLayout& layout,
                                        std::span<const Eigen::Vector3f> vertices_W);

}  // namespace relocd
