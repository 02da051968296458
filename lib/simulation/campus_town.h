#pragma once

#include "simulation/campus_furniture.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_plants.h"
#include "simulation/campus_random.h"
#include "simulation/campus_site.h"

namespace relocd {

/// What a town is furnished with.
struct CampusStock {
  CampusMaterials materials;
  CampusPlants plants;
  CampusFurniture furniture;
};

/// Builds the houses along all streets, with their front gardens.
void AddBuildings(const CampusStock& stock, CampusRandom random, CampusSite& site);

/// Lamps, signs, benches, trees: what stands along streets and in the park, and the woods round the
/// town.
void AddScenery(const CampusStock& stock, CampusRandom random, CampusSite& site);

}  // namespace relocd
