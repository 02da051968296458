#include "simulation/world.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "simulation/campus.h"
#include "simulation/torcs_track.h"

namespace relocd {
namespace {

constexpr std::string_view kCampus = "campus";
constexpr std::string_view kTorcsPrefix = "torcs:";

}  // namespace

std::vector<std::string> WorldNames() {
  std::vector<std::string> names{std::string(kCampus)};
  for (const std::string& track : ListTorcsTracks())
    names.push_back(std::string(kTorcsPrefix) + track);
  return names;
}

Result<World> MakeWorld(const std::string& name, std::uint64_t seed) {
  if (name == kCampus) return MakeCampus(seed);
  if (name.starts_with(kTorcsPrefix)) return ReadTorcsTrack(name.substr(kTorcsPrefix.size()));
  return Error{ErrorKind::kInvalidInput,
               fmt::format("world '{}' is unknown, must be one of {}, or torcs:FOLDER with a slash",
                           name,
                           fmt::join(WorldNames(), ", "))};
}

}  // namespace relocd
