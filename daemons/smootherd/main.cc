#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/file.h"
#include "core/parse_number.h"
#include "daemon/daemon.h"
#include "messaging/command_channels.h"
#include "smootherd/saved_state.h"
#include "smootherd/smoother_node.h"
#include "smootherd/state_writer.h"

namespace relocd {
namespace {

constexpr int kPriorityWarning = 4;
constexpr int kPriorityNotice = 5;

/// A random text that is new with each boot; empty where /proc is not.
std::string ReadBootId() {
  const auto text = ReadFile("/proc/sys/kernel/random/boot_id");
  return text ? std::string(Trim(*text)) : "";
}

class SmootherDaemon final : public Daemon {
 public:
  explicit SmootherDaemon(DaemonContext& context)
      : boot_id_(ReadBootId()),
        node_(context.config.localization,
              context.config.CameraMountings(),
              context.control_bus,
              context.run_id) {}

  Result<void> Start(DaemonContext& context) {
    const LocalizationConfig& config = context.config.localization;
    if (!config.state_file.empty()) {
      RestoreState(config.state_file);
      writer_.emplace(config.state_file);
      auto ok = context.loop.Every(FromSeconds(config.state_period_s), [this] { SaveState(); });
      if (!ok) return ok;
    }
    context.control_bus.Subscribe<odometry_t>(
        channels::kOdometry, Delivery::kEvery, [this](const odometry_t& m) {
          const MonotonicTime begin = MonotonicClock::now();
          node_.Handle(m);
          node_.NotePoseLatency(MonotonicClock::now() - begin);
        });
    context.control_bus.Subscribe<camera_pose_t>(
        channels::kCameraPose, Delivery::kEvery, [this](const camera_pose_t& m) {
          const MonotonicTime begin = MonotonicClock::now();
          node_.Handle(m);
          node_.NoteFixLatency(MonotonicClock::now() - begin);
        });
    context.control_bus.Subscribe<pose_t>(command_channels::kSetPose,
                                          Delivery::kNewest,
                                          [this](const pose_t& m) { node_.SetPose(m); });
    context.control_bus.Subscribe<text_t>(
        command_channels::kReset, Delivery::kNewest, [this](const text_t& m) {
          LogLine(kPriorityNotice, "smootherd", "the pose is forgotten: " + m.text);
          node_.Reset();
        });
    return {};
  }

  NodeStatus Status(const ClockReading& now) override {
    if (!is_restore_told_ && !node_.restore_outcome().empty()) {
      LogLine(kPriorityNotice, "smootherd", node_.restore_outcome());
      is_restore_told_ = true;
    }
    NodeStatus status = node_.Status(now);
    if (writer_) {
      const auto written = writer_->last_result();
      if (!written) {
        status.Raise(status_t::WARNING, "saving the pose: " + written.error().message);
      }
    }
    return status;
  }

  void Stop(const ClockReading& /*now*/) override {
    SaveState();
    writer_.reset();  // waits for the file
  }

 private:
  void RestoreState(const std::string& path) {
    std::error_code not_there;
    if (!std::filesystem::exists(path, not_there)) return;
    const auto text = ReadFile(path);
    const auto state = text ? ParseSavedState(*text, path) : Result<SavedState>(text.error());
    if (!state) {
      LogLine(
          kPriorityWarning, "smootherd", "the saved pose is not used: " + state.error().message);
      return;
    }
    node_.Restore(*state, boot_id_);
  }

  void SaveState() {
    const auto state = node_.State(boot_id_);
    if (state && writer_) writer_->Write(FormatSavedState(*state));
  }

  std::string boot_id_;
  SmootherNode node_;
  bool is_restore_told_ = false;
  std::optional<StateWriter> writer_;  ///< Has a thread: last, so that it ends first.
};

Result<std::unique_ptr<Daemon>> MakeSmoother(DaemonContext& context) {
  auto daemon = std::make_unique<SmootherDaemon>(context);
  if (auto ok = daemon->Start(context); !ok) return std::move(ok).error();
  return std::unique_ptr<Daemon>(std::move(daemon));
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  return relocd::RunDaemon(argc,
                           argv,
                           {.name = "smootherd",
                            .description = "Fuses odometry and camera poses into the pose.",
                            .uses_images = false,
                            .instance_option = ""},
                           relocd::MakeSmoother);
}
