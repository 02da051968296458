#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "rendering/scene.h"
#include "simulation/ac3d.h"

namespace relocd {

/// The vertices of all objects in W: AC3D's y is W's z, and its x is W's.
std::vector<Eigen::Vector3f> VerticesInWorld(const Ac3dModel& model);

/// The corners of all triangles in W, counter-clockwise seen from their outside.
std::vector<std::array<Eigen::Vector3f, 3>> TrianglesInWorld(const Ac3dModel& model);

struct TorcsSceneOptions {
  std::vector<std::string> texture_folders;  ///< In the order in which they are searched.
  /// Whether a level triangle with this middle is paved as the road is, and shines when it is wet,
  /// unless its texture is called after sand, grass and the like.
  std::function<bool(const Eigen::Vector3f& p_W)> is_road;
};

/// Makes a scene of a track's mesh: one mesh with all whole surfaces, one with those that have
/// holes, as their textures have; a material for each texture and plain colour, and for what rain
/// does to it. Surfaces that coincide are moved 5 mm apart, to where each is seen from.
///
/// @param path  of the model, for error messages.
/// @return kInvalidInput for a texture that is missing or damaged, naming it, the object that asks
///         for it, and the folders searched.
Result<Scene> MakeTorcsScene(const Ac3dModel& model,
                             const TorcsSceneOptions& options,
                             const std::string& path);

}  // namespace relocd
