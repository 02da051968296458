#pragma once

#include <cstdint>
#include <vector>

#include "rendering/scene.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_random.h"

namespace relocd {

/// Adds people in the middle of a step, in different clothes: x forward, z up, the origin on the
/// ground between their feet.
///
/// @return their meshes.
std::vector<std::uint32_t> AddPeopleMeshes(const CampusMaterials& materials,
                                           CampusRandom random,
                                           Scene& scene);

}  // namespace relocd
