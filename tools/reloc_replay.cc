#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <fmt/ranges.h>

#include "can/dbc.h"
#include "config/config.h"
#include "core/exit_code.h"
#include "inferenced/inference_node.h"
#include "messaging/image_metadata.h"
#include "messaging/in_process_bus.h"
#include "odometryd/odometry_node.h"
#include "recording/log_reader.h"
#include "recording/log_writer.h"
#include "relocalization/map_localizer.h"
#include "smootherd/smoother_node.h"

// reloc replay: the nodes of the daemons on a recorded log, in one thread, on the messages' own
// time. Two replays of a log give the same bytes.

namespace relocd {
namespace {

struct Options {
  std::string log;
  std::string out;
  std::string config;
  std::vector<std::string> overrides;
  std::vector<std::string> nodes{"inference", "smoothing"};
};

/// All messages of a replay are of this run.
constexpr std::int64_t kReplayRunId = 1;

class Replay {
 public:
  Replay(const Config& config, LogWriter out) : config_(config), out_(std::move(out)) {
    bus_.SubscribeRaw(".*",
                      [this](const std::string& channel, std::span<const std::uint8_t> bytes) {
                        if (std::exchange(input_is_next_, false)) return;
                        if (!error_) error_ = ErrorOf(out_.Append(input_time_us_, channel, bytes));
                        ++outputs_;
                      });
  }

  Result<void> AddNode(const std::string& name) {
    if (name == "odometry") return AddOdometry();
    if (name == "inference") return AddInference();
    if (name == "smoothing") return AddSmoothing();
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("--nodes has '{}', must be of odometry, inference, smoothing", name)};
  }

  Result<void> Run(LogReader& log) {
    while (const auto event = log.Next()) {
      if (replaced_.contains(event->channel)) continue;
      SetTime(*event);
      input_time_us_ = event->timestamp_us;
      input_is_next_ = true;
      if (auto ok = bus_.PublishBytes(event->channel, event->data); !ok) return ok;
      bus_.HandlePending();
      if (error_) return *error_;
    }
    return out_.Flush();
  }

  [[nodiscard]] std::int64_t outputs() const { return outputs_; }

 private:
  static std::optional<Error> ErrorOf(const Result<void>& result) {
    if (result) return std::nullopt;
    return result.error();
  }

  Result<void> AddOdometry() {
    const auto dbc = DbcFile::Read(config_.can.dbc_file);
    if (!dbc) return dbc.error();
    auto odometry = WheelOdometry::Create(config_.odometry, *dbc, config_.can.messages);
    if (!odometry) return std::move(odometry).error();
    odometry_ = std::make_unique<OdometryNode>(
        config_.can, std::move(odometry).value(), bus_, kReplayRunId);
    bus_.Subscribe<can_frames_t>(
        CanChannel(config_.can.interface), Delivery::kEvery, [this](const can_frames_t& frames) {
          odometry_->Handle(frames);
          odometry_->Tick(now_);
        });
    replaced_.insert(channels::kOdometry.name);
    return {};
  }

  Result<void> AddInference() {
    const InferenceConfig& config = config_.inference;
    auto localizer = MapLocalizer::Load(config);
    if (!localizer) return std::move(localizer).error();
    inference_ = std::make_unique<InferenceNode>(
        config, std::move(*localizer), config_.CameraMountings(), bus_, kReplayRunId, [this] {
          return now_;
        });
    bus_.Subscribe<localization_t>(
        channels::kLocalization, Delivery::kNewest, [this](const localization_t& localization) {
          inference_->Handle(localization);
        });
    for (const auto& [camera, unused] : config_.cameras) {
      bus_.Subscribe<image_t>(
          ImageChannel(camera), Delivery::kEvery, [this, name = camera](const image_t& image) {
            inference_->Handle(name, image);
          });
    }
    replaced_.insert(channels::kCameraPose.name);
    return {};
  }

  Result<void> AddSmoothing() {
    smoother_ = std::make_unique<SmootherNode>(
        config_.localization, config_.CameraMountings(), bus_, kReplayRunId);
    bus_.Subscribe<odometry_t>(channels::kOdometry,
                               Delivery::kEvery,
                               [this](const odometry_t& message) { smoother_->Handle(message); });
    bus_.Subscribe<camera_pose_t>(
        channels::kCameraPose, Delivery::kEvery, [this](const camera_pose_t& message) {
          smoother_->Handle(message);
        });
    replaced_.insert(
        {channels::kPose.name, channels::kLocalization.name, channels::kMapToOdom.name});
    return {};
  }

  /// The clock stands at the measurement's time while its message is handled.
  void SetTime(const LogEvent& event) {
    if (const auto image = DecodeBounded<image_t>(event.data)) {
      if (const auto metadata = FindImageMetadata(*image)) {
        now_ = {.monotonic = FromNanoseconds(metadata->mono_ns), .realtime_us = image->utime};
      }
    } else if (const auto frames = DecodeBounded<can_frames_t>(event.data)) {
      now_ = {.monotonic = FromNanoseconds(frames->mono_ns), .realtime_us = frames->utime};
    }
  }

  const Config& config_;
  LogWriter out_;
  InProcessBus bus_;
  std::unique_ptr<OdometryNode> odometry_;
  std::unique_ptr<InferenceNode> inference_;
  std::unique_ptr<SmootherNode> smoother_;
  std::set<std::string> replaced_;  ///< Channels that the nodes publish here anew.

  ClockReading now_;
  bool input_is_next_ = false;
  std::int64_t input_time_us_ = 0;
  std::int64_t outputs_ = 0;
  std::optional<Error> error_;
};

Result<void> Run(const Options& options) {
  auto config = LoadConfig(options.config, options.overrides);
  if (!config) return std::move(config).error();
  auto log = LogReader::Open(options.log);
  if (!log) return std::move(log).error();
  auto out = LogWriter::Create(options.out);
  if (!out) return std::move(out).error();

  Replay replay(*config, std::move(out).value());
  for (const std::string& node : options.nodes) {
    if (auto ok = replay.AddNode(node); !ok) return ok;
  }
  if (auto ok = replay.Run(*log); !ok) return ok;
  fmt::print(stderr,
             "{}: {} messages in, {} out; {} damaged places\n",
             options.out,
             log->counters().events,
             replay.outputs(),
             log->counters().damaged_places);
  return {};
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  relocd::Options options;
  CLI::App app("Runs the daemons' nodes on a recorded log: one thread, message time, no sockets.",
               "reloc replay");
  app.add_option("--log", options.log, "a log of recorderd or lcm-logger")->required();
  app.add_option("--out", options.out, "what the nodes publish, as a log")->required();
  app.add_option("--config", options.config, "the robot's YAML file")->required();
  app.add_option("--set", options.overrides, "section.key=value, put over the file's")
      ->allow_extra_args(false);
  app.add_option("--nodes",
                 options.nodes,
                 "of odometry, inference, smoothing; their messages in the log are passed over")
      ->delimiter(',')
      ->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (const auto ok = relocd::Run(options); !ok) {
    fmt::print(stderr, "reloc replay: {}\n", ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
