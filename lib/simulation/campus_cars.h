#pragma once

#include <cstdint>
#include <vector>

#include "rendering/scene.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_random.h"

namespace relocd {

/// Adds cars of several kinds and colours: x forward, z up, the origin on the ground in their
/// middle. At most 5.9 m long.
///
/// @return their meshes.
std::vector<std::uint32_t> AddCarMeshes(const CampusMaterials& materials,
                                        CampusRandom random,
                                        Scene& scene);

}  // namespace relocd
