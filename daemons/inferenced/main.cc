#include <utility>

#include "daemon/daemon.h"
#include "inferenced/inference_node.h"
#include "relocalization/map_localizer.h"
#include "runtime/start_extension.h"

namespace relocd {
namespace {

class InferenceDaemon final : public Daemon {
 public:
  InferenceDaemon(DaemonContext& context, std::unique_ptr<ImageLocalizer> localizer)
      : node_(context.config.inference,
              std::move(localizer),
              context.config.CameraMountings(),
              context.control_bus,
              context.run_id,
              ReadClocks) {
    context.control_bus.Subscribe<localization_t>(
        channels::kLocalization, Delivery::kNewest, [this](const localization_t& localization) {
          node_.Handle(localization);
        });
    for (const auto& [camera, config] : context.config.cameras) {
      context.image_bus->Subscribe<image_t>(
          ImageChannel(camera), Delivery::kNewest, [this, name = camera](const image_t& image) {
            node_.Handle(name, image);
          });
    }
  }

  NodeStatus Status(const ClockReading& now) override { return node_.Status(now); }

 private:
  InferenceNode node_;
};

Result<std::unique_ptr<Daemon>> MakeInference(DaemonContext& context) {
  const InferenceConfig& config = context.config.inference;
  StartExtension start(context.service_manager,
                       FromSeconds(context.config.supervisor.inferenced.start_timeout_s));
  auto localizer = MapLocalizer::Load(config, [&start] { start.Step(MonotonicClock::now()); });
  if (!localizer) return std::move(localizer).error().WithContext("inference");
  return std::unique_ptr<Daemon>(std::make_unique<InferenceDaemon>(context, std::move(*localizer)));
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  return relocd::RunDaemon(argc,
                           argv,
                           {.name = "inferenced",
                            .description = "Tells where the camera is on the map, image by image.",
                            .uses_images = true,
                            .instance_option = ""},
                           relocd::MakeInference);
}
