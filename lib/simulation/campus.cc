#include "simulation/campus.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "simulation/campus_cars.h"
#include "simulation/campus_furniture.h"
#include "simulation/campus_ground.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_people.h"
#include "simulation/campus_plants.h"
#include "simulation/campus_random.h"
#include "simulation/campus_road_marks.h"
#include "simulation/campus_roads.h"
#include "simulation/campus_site.h"
#include "simulation/campus_surfaces.h"
#include "simulation/campus_town.h"

namespace relocd {
namespace {

// Which numbers each part of the town draws.
enum class TownPart : std::uint64_t {
  kTerrain,
  kRoads,
  kMaterials,
  kMarks,
  kPlants,
  kFurniture,
  kBuildings,
  kScenery,
  kCars,
  kPeople
};

/// The middle of the sidewalks, along the kerbs.
std::vector<Path> MakeWalkways(const RoadField& field) {
  constexpr double kFromKerb = 1.35;
  std::vector<Path> walkways;
  for (const RoadContour& contour : field.Contours(kFromKerb)) {
    PlaneLine line = Resampled(contour.points, 0.5, true);
    line = SmoothedLine(std::move(line), 8, true);
    walkways.push_back({.points = Resampled(line, 1.0, true), .is_closed = true});
  }
  return walkways;
}

}  // namespace

Result<World> MakeCampus(std::uint64_t seed) {
  const CampusRandom random(seed);
  const auto part = [&random](TownPart which) {
    return random.Fork(static_cast<std::uint64_t>(which));
  };
  World world;
  world.name = "campus";
  const RoadNetwork network = MakeRoadNetwork(part(TownPart::kRoads));
  const auto ground = std::make_shared<const CampusGround>(CampusTerrain(part(TownPart::kTerrain)),
                                                           MakeRoadField(network));
  world.ground = ground;
  world.route = network.route;
  world.traffic = network.traffic;
  world.parking_spots = network.parking_spots;
  world.walkways = MakeWalkways(ground->roads());

  CampusStock stock;
  stock.materials = MakeCampusMaterials(part(TownPart::kMaterials), world.scene);
  AddSurfaces(*ground, stock.materials, network, world.scene);
  AddRoadMarks(*ground, stock.materials, network, part(TownPart::kMarks), world.scene);
  stock.plants = MakeCampusPlants(stock.materials, part(TownPart::kPlants), world.scene);
  stock.furniture = MakeCampusFurniture(stock.materials, part(TownPart::kFurniture), world.scene);
  CampusSite site(*ground, network, world.scene);
  AddBuildings(stock, part(TownPart::kBuildings), site);
  AddScenery(stock, part(TownPart::kScenery), site);
  world.car_meshes = AddCarMeshes(stock.materials, part(TownPart::kCars), world.scene);
  world.pedestrian_meshes = AddPeopleMeshes(stock.materials, part(TownPart::kPeople), world.scene);
  if (auto ok = world.scene.Validate(); !ok) return ok.error();
  return world;
}

}  // namespace relocd
