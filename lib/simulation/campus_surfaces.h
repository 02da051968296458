#pragma once

#include "rendering/scene.h"
#include "simulation/campus_ground.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_roads.h"

namespace relocd {

/// Adds what one drives and walks on: roads with kerbs and gutters, sidewalks, lawns, and hills
/// round the town.
void AddSurfaces(const CampusGround& ground,
                 const CampusMaterials& materials,
                 const RoadNetwork& network,
                 Scene& scene);

}  // namespace relocd
