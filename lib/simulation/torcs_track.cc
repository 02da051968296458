#include "simulation/torcs_track.h"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "core/file.h"
#include "core/nearest_name.h"
#include "simulation/ac3d.h"
#include "simulation/torcs_ground.h"
#include "simulation/torcs_lane.h"
#include "simulation/torcs_layout.h"
#include "simulation/torcs_placement.h"
#include "simulation/torcs_scene.h"

namespace relocd {
namespace {

namespace fs = std::filesystem;

constexpr double kWideRoadM = 12.0;  ///< With room for a lane between the two others.

/// The folders in a folder, in order of their names; none where it cannot be read.
std::vector<fs::path> FoldersIn(const fs::path& folder) {
  std::vector<fs::path> folders;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.is_directory(ignored)) folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

/// ROOT/tracks/KIND/NAME with NAME.xml in it.
std::vector<fs::path> TrackFolders(const std::string& root) {
  std::vector<fs::path> tracks;
  std::error_code ignored;
  for (const fs::path& kind : FoldersIn(fs::path(root) / "tracks")) {
    for (const fs::path& track : FoldersIn(kind)) {
      if (fs::is_regular_file(track / (track.filename().string() + ".xml"), ignored))
        tracks.push_back(track);
    }
  }
  return tracks;
}

Result<fs::path> FindTrack(const std::string& name, const std::string& root) {
  const std::vector<fs::path> tracks = TrackFolders(root);
  if (tracks.empty())
    return Error{ErrorKind::kUnavailable,
                 fmt::format("track '{}': there are no tracks in {}/tracks; install Debian's "
                             "torcs-data, or set RELOCD_TORCS_ROOT",
                             name,
                             root)};
  std::vector<std::string> names;
  for (const fs::path& track : tracks) {
    if (track.filename() == name) return track;
    names.push_back(track.filename().string());
  }
  const std::string nearest = NearestNames(name, names, 1).front();
  return Error{ErrorKind::kInvalidInput,
               fmt::format("unknown track '{}', the nearest in {}/tracks is '{}'; a folder with "
                           "a track is given with a slash, as in ./{}",
                           name,
                           root,
                           nearest,
                           name)};
}

/// A track folder's own name, also of `folder/` and `.`.
std::string NameOf(const fs::path& folder) {
  std::error_code ignored;
  fs::path whole = fs::weakly_canonical(folder, ignored);
  if (whole.empty()) whole = folder;
  return whole.filename().string();
}

std::vector<TorcsStation> StationsInWorld(std::vector<TorcsStation> stations,
                                          const Eigen::Vector3d& p_WT) {
  for (TorcsStation& station : stations) {
    station.p_T += p_WT.head<2>();
    station.left_z_T += p_WT.z();
    station.right_z_T += p_WT.z();
  }
  return stations;
}

Result<World> MakeWorldOf(const TorcsLayout& layout,
                          const Ac3dModel& model,
                          const std::vector<std::string>& texture_folders,
                          const std::string& mesh_path) {
  const auto p_WT = FindTrackInMesh(layout, VerticesInWorld(model));
  if (!p_WT) return Error(p_WT.error()).WithContext(mesh_path);
  const auto stations_W = StationsInWorld(layout.stations, *p_WT);
  auto ground = TorcsGround::Create(stations_W, layout.width_m, TrianglesInWorld(model));
  if (!ground) return std::move(ground).error().WithContext(mesh_path);
  constexpr double kPavedM = 10.0;  // beside the road: pit lanes, and what TORCS calls sides
  const TorcsSceneOptions options{.texture_folders = texture_folders,
                                  .is_road = [&](const Eigen::Vector3f& p_W) {
                                    return (*ground)->IsOnRoad(p_W.cast<double>(), kPavedM);
                                  }};
  auto scene = MakeTorcsScene(model, options, mesh_path);
  if (!scene) return std::move(scene).error();

  const double lane_m = layout.width_m / 4.0;
  World world;
  world.scene = std::move(scene).value();
  world.ground = *ground;
  world.route = MakeTorcsLane(stations_W, -lane_m);
  world.traffic.push_back(Reversed(MakeTorcsLane(stations_W, lane_m)));
  if (layout.width_m >= kWideRoadM) world.traffic.push_back(MakeTorcsLane(stations_W, 0.0));
  return world;
}

}  // namespace

std::string TorcsRoot(const std::string& root) {
  if (!root.empty()) return root;
  const char* const from_environment =
      std::getenv("RELOCD_TORCS_ROOT");  // NOLINT(concurrency-mt-unsafe): nothing sets it
  if (from_environment != nullptr && *from_environment != '\0') return from_environment;
  return "/usr/share/games/torcs";
}

std::vector<std::string> ListTorcsTracks(const std::string& root) {
  std::vector<std::string> names;
  for (const fs::path& track : TrackFolders(TorcsRoot(root))) {
    names.push_back(track.filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

Result<World> ReadTorcsTrack(const std::string& name_or_folder, const std::string& root) {
  const std::string search_root = TorcsRoot(root);
  fs::path folder = name_or_folder;
  if (name_or_folder.find('/') == std::string::npos) {
    auto found = FindTrack(name_or_folder, search_root);
    if (!found) return std::move(found).error();
    folder = std::move(found).value();
  }
  const std::string name = NameOf(folder);
  const std::string layout_path = (folder / (name + ".xml")).string();
  const auto xml = ReadFile(layout_path);
  if (!xml) return xml.error();
  const auto layout = ParseTorcsLayout(*xml, layout_path);
  if (!layout) return layout.error();

  // What a file of unknown origin asks for stays in the folder.
  const std::string mesh_path = (folder / fs::path(layout->mesh_file).filename()).string();
  const auto model = ReadAc3d(mesh_path);
  if (!model) return model.error();
  auto world =
      MakeWorldOf(*layout, *model, {folder.string(), search_root + "/data/textures"}, mesh_path);
  if (world) world->name = "torcs:" + name_or_folder;
  return world;
}

}  // namespace relocd
