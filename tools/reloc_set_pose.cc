#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "config/config.h"
#include "core/exit_code.h"
#include "messaging/command_channels.h"
#include "smoother_command.h"

// reloc set-pose: tells smootherd where the robot is.

int main(int argc, char** argv) {
  CLI::App app("Tells smootherd where the robot is: within 2 m and 0.2 rad, from now on.",
               "reloc set-pose");
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_deg = 0.0;
  std::string url = relocd::BusConfig().control_url;
  app.add_option("X", x_m, "in the map, m")->required();
  app.add_option("Y", y_m, "in the map, m")->required();
  app.add_option("HEADING", heading_deg, "from the map's x axis towards its y axis, deg")
      ->required();
  app.add_option("--lcm-url", url, "the control network")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (!std::isfinite(x_m) || !std::isfinite(y_m) || !std::isfinite(heading_deg)) {
    fmt::print(stderr, "reloc set-pose: {} {} {} must be finite\n", x_m, y_m, heading_deg);
    return relocd::kExitUsage;
  }
  relocd::pose_t pose{};
  pose.pos[0] = x_m;
  pose.pos[1] = y_m;
  const double half_rad = heading_deg * std::numbers::pi / 360.0;
  pose.orientation[0] = std::cos(half_rad);
  pose.orientation[3] = std::sin(half_rad);
  // A robot that drives has moved on when the next message comes.
  constexpr double kReachM = 5.0;
  const auto done = relocd::CommandSmoother(
      url,
      [&](relocd::MessageBus& bus) {
        return bus.Publish(relocd::command_channels::kSetPose, pose);
      },
      [&](const relocd::localization_t& message) {
        return std::hypot(message.x_WB_m - x_m, message.y_WB_m - y_m) < kReachM;
      });
  if (done) return relocd::kExitOk;
  fmt::print(stderr, "reloc set-pose: {}\n", done.error().message);
  return relocd::ExitCode(done.error());
}
