#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "camera/file_frame_source.h"
#include "camera/v4l2_frame_source.h"
#include "camerad/camera_node.h"
#include "camerad/source_waiter.h"
#include "core/playback_epoch.h"
#include "daemon/daemon.h"

namespace relocd {
namespace {

constexpr int kNotice = 5;  // syslog's

Result<CameraConfig> FindCamera(const DaemonContext& context) {
  const auto found = context.config.cameras.find(context.instance);
  if (found != context.config.cameras.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& [name, camera] : context.config.cameras)
    names.push_back(name);
  return Error{ErrorKind::kInvalidInput,
               fmt::format("--camera is '{}', must be one of cameras: {}",
                           context.instance,
                           fmt::join(names, ", "))};
}

/// A camera's driver and node, hooked into the loop.
class CameraDaemon final : public Daemon {
 public:
  static Result<std::unique_ptr<Daemon>> Make(DaemonContext& context) {
    auto config = FindCamera(context);
    if (!config) return std::move(config).error();
    auto waiter = SourceWaiter::Create();
    if (!waiter) return std::move(waiter).error();
    std::unique_ptr<CameraDaemon> daemon(
        new CameraDaemon("camerad_" + context.instance, std::move(waiter).value()));
    if (auto ok = daemon->Start(*config, context); !ok) return std::move(ok).error();
    return std::unique_ptr<Daemon>(std::move(daemon));
  }

  NodeStatus Status(const ClockReading& now) override {
    NodeStatus status = node_->Status(now);
    if (!wait_error_.empty()) status.Raise(status_t::ERROR, wait_error_);
    return status;
  }

 private:
  CameraDaemon(std::string name, SourceWaiter waiter)
      : name_(std::move(name)), waiter_(std::move(waiter)) {}

  Result<void> Start(const CameraConfig& config, DaemonContext& context) {
    const MonotonicTime now = MonotonicClock::now();
    if (config.driver == "file") {
      auto source = FileFrameSource::Open(config.file, PlaybackEpoch(now));
      if (!source) return std::move(source).error();
      source_ = std::move(source).value();
    } else {
      source_ = std::make_unique<V4l2FrameSource>(config, kernel_);
    }
    if (auto ok = source_->Start(now); !ok) return ok;
    node_ = std::make_unique<CameraNode>(
        context.instance, config, *source_, *context.image_bus, context.run_id);
    if (auto ok = waiter_.Follow(*source_); !ok) return ok;
    return context.loop.OnReadable(waiter_.fd(), [this] { HandleSource(); });
  }

  void HandleSource() {
    node_->HandleSource(ReadClocks());
    for (const std::string& notice : node_->TakeNotices())
      LogLine(kNotice, name_, notice);
    auto ok = waiter_.Follow(*source_);
    wait_error_ = ok ? "" : ok.error().message;
  }

  std::string name_;
  std::string wait_error_;
  KernelV4l2System kernel_;
  SourceWaiter waiter_;
  std::unique_ptr<FrameSource> source_;
  std::unique_ptr<CameraNode> node_;
};

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  return relocd::RunDaemon(argc,
                           argv,
                           {.name = "camerad",
                            .description = "Publishes a camera's images as IMAGE_<camera>.",
                            .uses_images = true,
                            .instance_option = "camera"},
                           relocd::CameraDaemon::Make);
}
