#include "map_checkpoint.h"

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/file.h"
#include "core/sha256.h"

namespace relocd {
namespace {

constexpr std::string_view kStateMagic = "RELOCST1";
constexpr std::size_t kHashSize = 64;

void AppendFloats(const std::vector<float>& values, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
}

/// Takes bytes off the front.
template <typename T>
T Take(std::string_view& bytes) {
  T value{};
  std::memcpy(&value, bytes.data(), sizeof(T));
  bytes.remove_prefix(sizeof(T));
  return value;
}

std::vector<float> TakeFloats(std::string_view& bytes, std::size_t count) {
  std::vector<float> values(count);
  std::memcpy(values.data(), bytes.data(), count * sizeof(float));
  bytes.remove_prefix(count * sizeof(float));
  return values;
}

}  // namespace

std::string SerializeState(const TrainerState& state, const std::string& fingerprint) {
  std::string bytes(kStateMagic);
  bytes += fingerprint;
  const auto iteration = static_cast<std::uint32_t>(state.iteration);
  const auto count = static_cast<std::uint32_t>(state.parameters.size());
  bytes.append(reinterpret_cast<const char*>(&iteration), sizeof(iteration));
  bytes.append(reinterpret_cast<const char*>(&count), sizeof(count));
  for (const auto* values : {&state.parameters, &state.momentum, &state.variance})
    AppendFloats(*values, bytes);
  return bytes + Sha256Hex(bytes);
}

std::optional<TrainerState> ParseState(std::string_view bytes, const std::string& fingerprint) {
  const std::size_t header = kStateMagic.size() + fingerprint.size() + 2 * sizeof(std::uint32_t);
  if (bytes.size() < header + kHashSize) return std::nullopt;
  const std::string_view content = bytes.substr(0, bytes.size() - kHashSize);
  if (Sha256Hex(content) != bytes.substr(content.size())) return std::nullopt;
  std::string_view rest = content;
  for (const std::string_view expected : {kStateMagic, std::string_view{fingerprint}}) {
    if (!rest.starts_with(expected)) return std::nullopt;
    rest.remove_prefix(expected.size());
  }
  const auto iteration = Take<std::uint32_t>(rest);
  const std::size_t count = Take<std::uint32_t>(rest);
  if (iteration > static_cast<std::uint32_t>(std::numeric_limits<int>::max()) ||
      rest.size() != 3 * count * sizeof(float)) {
    return std::nullopt;
  }
  TrainerState state;
  state.iteration = static_cast<int>(iteration);
  state.parameters = TakeFloats(rest, count);
  state.momentum = TakeFloats(rest, count);
  state.variance = TakeFloats(rest, count);
  return state;
}

std::string FingerprintOf(const std::vector<SelectedFrames>& drives) {
  std::string text;
  for (const SelectedFrames& drive : drives) {
    const CameraIntrinsics& camera = drive.dataset.intrinsics;
    text += fmt::format("{} {} {} {} {} {} {}\n",
                        camera.fx,
                        camera.fy,
                        camera.cx,
                        camera.cy,
                        camera.width,
                        camera.height,
                        fmt::join(camera.distortion, " "));
    for (const DatasetFrame& frame : drive.dataset.frames) {
      std::error_code ignored;  // what is missing is found when it is read
      const auto size = std::filesystem::file_size(frame.image_path, ignored);
      const auto changed = std::filesystem::last_write_time(frame.image_path, ignored);
      const Eigen::Quaterniond& q = frame.X_WC.rotation();
      text += fmt::format("{} {} {} {} {} {} {}\n",
                          frame.index,
                          frame.image_path,
                          frame.depth_path,
                          size,
                          changed.time_since_epoch().count(),
                          fmt::join(std::span(frame.X_WC.translation().data(), 3), " "),
                          fmt::join(std::span(q.coeffs().data(), 4), " "));
    }
  }
  return Sha256Hex(text);
}

TrainingFolder::TrainingFolder(std::string path, std::string fingerprint)
    : path_(std::move(path)), fingerprint_(std::move(fingerprint)) {}

std::string TrainingFolder::RegionPath(std::size_t region) const {
  return fmt::format("{}/region{}.relocmap", path_, region);
}
std::string TrainingFolder::StatePath(std::size_t region) const {
  return fmt::format("{}/region{}.state", path_, region);
}

Result<TrainingFolder> TrainingFolder::Open(const std::string& map_path,
                                            const std::string& fingerprint) {
  TrainingFolder folder(map_path + ".partial", fingerprint);
  std::error_code failed;
  std::filesystem::create_directories(folder.path_, failed);
  if (failed) {
    return Error{ErrorKind::kUnavailable,
                 fmt::format("making the folder {}: {}", folder.path_, failed.message())};
  }
  const std::string name = folder.path_ + "/fingerprint";
  const auto before = ReadFile(name);
  if (before && *before == fingerprint) return folder;
  for (std::size_t region = 0; std::filesystem::remove(folder.RegionPath(region), failed) ||
                               std::filesystem::remove(folder.StatePath(region), failed);
       ++region) {
    std::filesystem::remove(folder.StatePath(region), failed);
  }
  if (auto written = WriteFileAtomically(name, fingerprint); !written) return written.error();
  return folder;
}

std::optional<MapRegion> TrainingFolder::FinishedRegion(std::size_t region) const {
  auto map = ReadMap(RegionPath(region));
  if (!map || map->training.dataset != fingerprint_ || map->regions.size() != 1) {
    return std::nullopt;
  }
  return std::move(map->regions.front());
}

std::optional<TrainerState> TrainingFolder::State(std::size_t region) const {
  const auto bytes = ReadFile(StatePath(region));
  return bytes ? ParseState(*bytes, fingerprint_) : std::nullopt;
}

Result<void> TrainingFolder::KeepRegion(std::size_t region, const SceneMap& map) const {
  SceneMap marked = map;
  marked.training.dataset = fingerprint_;
  return WriteMap(marked, RegionPath(region));
}

Result<void> TrainingFolder::KeepState(std::size_t region, const TrainerState& state) const {
  return WriteFileAtomically(StatePath(region), SerializeState(state, fingerprint_));
}

void TrainingFolder::Remove() const {
  std::error_code ignored;  // what stays is seen by the next training, and does no harm
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace relocd
