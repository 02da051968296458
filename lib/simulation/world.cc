#include "simulation/world.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "simulation/campus.h"
#include "simulation/campus_cars.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_random.h"
#include "simulation/torcs_track.h"

namespace relocd {
namespace {

constexpr std::string_view kCampus = "campus";
constexpr std::string_view kTorcsPrefix = "torcs:";

/// The cars that drive on the campus, for a world that has none of its own.
void AddCars(const CampusRandom& random, World& world) {
  const CampusMaterials materials = MakeCampusMaterials(random.Fork(0), world.scene);
  world.car_meshes = AddCarMeshes(materials, random.Fork(1), world.scene);
}

}  // namespace

std::vector<std::string> WorldNames() {
  std::vector<std::string> names{std::string(kCampus)};
  for (const std::string& track : ListTorcsTracks())
    names.push_back(std::string(kTorcsPrefix) + track);
  return names;
}

Result<World> MakeWorld(const std::string& name, std::uint64_t seed) {
  if (name == kCampus) return MakeCampus(seed);
  if (name.starts_with(kTorcsPrefix)) {
    auto world = ReadTorcsTrack(name.substr(kTorcsPrefix.size()));
    if (world) AddCars(CampusRandom(seed), *world);
    return world;
  }
  return Error{ErrorKind::kInvalidInput,
               fmt::format("world '{}' is unknown, must be one of {}, or torcs:FOLDER with a slash",
                           name,
                           fmt::join(WorldNames(), ", "))};
}

}  // namespace relocd
