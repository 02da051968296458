#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "camera/dataset.h"
#include "can/candump_log.h"
#include "core/file.h"
#include "sim_commands.h"
#include "sim_live.h"
#include "simulation/live_player.h"

// reloc sim play: a recorded drive on the devices of a robot, on the wall clock.

namespace relocd {
namespace {

struct Options {
  std::string dataset;
  std::string can_log;
  double playback_start_s = 0.0;
  LiveOptions live;
};

/// What a log carries from a time on, which becomes 0.
Result<std::vector<CandumpRecord>> ReadCan(const std::string& path, std::int64_t start_ns) {
  auto log = CandumpLog::Open(path);
  if (!log) return std::move(log).error();
  std::vector<CandumpRecord> records;
  while (true) {
    auto record = log->Next();
    if (!record) return std::move(record).error();
    if (!record->has_value()) break;
    (*record)->time_ns -= start_ns;
    if ((*record)->time_ns >= 0) records.push_back(**record);
  }
  if (const std::string left_out = log->LeftOut(); !left_out.empty()) {
    fmt::print(stderr, "reloc sim play: {}\n", left_out);
  }
  // Each interface has an order of its own.
  std::stable_sort(
      records.begin(), records.end(), [](const CandumpRecord& a, const CandumpRecord& b) {
        return a.time_ns < b.time_ns;
      });
  return records;
}

/// A data set's images from a time on.
struct Images {
  LiveDevices::Images format;
  std::vector<std::string> paths;
  std::vector<std::int64_t> times_ns;
};

Result<Images> ReadImages(const std::string& folder, std::int64_t start_ns) {
  auto dataset = ReadDataset(folder);
  if (!dataset) return std::move(dataset).error();
  Images images;
  for (const DatasetFrame& frame : dataset->frames) {
    if (frame.time_ns < start_ns) continue;
    images.paths.push_back(frame.image_path);
    images.times_ns.push_back(frame.time_ns - start_ns);
  }
  if (images.paths.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: has no image after --playback-start-s", folder)};
  }
  const double span_s =
      static_cast<double>(images.times_ns.back() - images.times_ns.front()) * 1e-9;
  constexpr double kOneImageRateHz = 1.0;
  images.format = {.width = dataset->intrinsics.width,
                   .height = dataset->intrinsics.height,
                   .frame_rate_hz = span_s > 0.0
                                        ? static_cast<double>(images.paths.size() - 1) / span_s
                                        : kOneImageRateHz};
  return images;
}

Result<void> PlayDrive(const Options& options) {
  if (!options.live.IsAny()) {
    return Error{ErrorKind::kInvalidInput,
                 "nothing to play to, must have --live-can, --live-video "
                 "or both"};
  }
  const std::int64_t start_ns = std::llround(options.playback_start_s * 1e9);
  LivePlayer::Drive drive;
  if (!options.live.can.empty()) {
    auto frames = ReadCan(options.can_log.empty() ? options.dataset + "/can0.log" : options.can_log,
                          start_ns);
    if (!frames) return std::move(frames).error();
    drive.frames = std::move(frames).value();
  }
  Images images;
  if (!options.live.video.empty()) {
    auto read = ReadImages(options.dataset, start_ns);
    if (!read) return std::move(read).error();
    images = std::move(read).value();
  }
  drive.image_times_ns = images.times_ns;
  drive.image = [&](std::size_t i) -> Result<std::optional<std::vector<std::uint8_t>>> {
    auto bytes = ReadFile(images.paths[i]);
    if (!bytes) return std::move(bytes).error();
    return std::optional(std::vector<std::uint8_t>(bytes->begin(), bytes->end()));
  };
  auto devices = LiveDevices::Open(options.live, images.format);
  if (!devices) return std::move(devices).error();
  LivePlayer player(std::move(drive), (*devices)->outputs(), LivePlayer::WallClock());
  const std::atomic<bool> never = false;
  auto played = player.Play(LiveEpoch(), never);
  fmt::print("{}", (*devices)->Summary(player.counters()));
  return played;
}

}  // namespace

void AddSimPlay(CLI::App& app, SimCommand& command) {
  const auto options = std::make_shared<Options>();  // lives as long as the parser's callback
  CLI::App& play =
      *app.add_subcommand("play", "a recorded drive on the devices of a robot, on the wall clock");
  play.add_option("--dataset", options->dataset, "the drive's folder")->required();
  play.add_option("--can0", options->can_log, "its candump log; without, DATASET/can0.log");
  play.add_option("--playback-start-s", options->playback_start_s, "leave out what is before")
      ->capture_default_str();
  AddLiveOptions(play, options->live);
  play.callback([options, &command] { command = [options] { return PlayDrive(*options); }; });
}

}  // namespace relocd
