#pragma once

#include "rendering/scene.h"
#include "simulation/campus_ground.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_random.h"
#include "simulation/campus_roads.h"

namespace relocd {

/// Adds what lies on roads: marks, manholes and drains, patches and cracks.
void AddRoadMarks(const CampusGround& ground,
                  const CampusMaterials& materials,
                  const RoadNetwork& network,
                  CampusRandom random,
                  Scene& scene);

}  // namespace relocd
