#include <utility>

#include "daemon/daemon.h"
#include "recorderd/recorder_node.h"

namespace relocd {
namespace {

constexpr int kPriorityError = 3;

class RecorderDaemon final : public Daemon {
 public:
  explicit RecorderDaemon(DaemonContext& context)
      : node_(context.config.recorder, context.run_id) {}

  Result<void> Start(DaemonContext& context) {
    if (auto ok = node_.Start(); !ok) return ok;
    for (MessageBus* bus : {&context.control_bus, context.image_bus}) {
      bus->SubscribeRaw(".*",
                        [this](const std::string& channel, std::span<const std::uint8_t> bytes) {
                          node_.Handle(channel, bytes, ReadClocks().realtime_us);
                        });
    }
    return context.loop.Every(FromSeconds(context.config.recorder.flush_s),
                              [this] { node_.Flush(); });
  }

  NodeStatus Status(const ClockReading& now) override { return node_.Status(now); }

  void Stop(const ClockReading& /*now*/) override {
    if (auto ok = node_.Stop(); !ok) LogLine(kPriorityError, "recorderd", ok.error().message);
  }

 private:
  RecorderNode node_;
};

Result<std::unique_ptr<Daemon>> MakeRecorder(DaemonContext& context) {
  auto daemon = std::make_unique<RecorderDaemon>(context);
  if (auto ok = daemon->Start(context); !ok) return std::move(ok).error();
  return std::unique_ptr<Daemon>(std::move(daemon));
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  return relocd::RunDaemon(argc,
                           argv,
                           {.name = "recorderd",
                            .description = "Records every message in lcm-logger's format.",
                            .uses_images = true,
                            .instance_option = ""},
                           relocd::MakeRecorder);
}
