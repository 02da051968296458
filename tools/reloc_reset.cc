#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "config/config.h"
#include "core/exit_code.h"
#include "messaging/command_channels.h"
#include "smoother_command.h"

// reloc reset: smootherd forgets the pose, and starts anew from the fixes that come.

int main(int argc, char** argv) {
  CLI::App app("Lets smootherd forget the pose, and start anew from the fixes that come.",
               "reloc reset");
  std::string url = relocd::BusConfig().control_url;
  app.add_option("--lcm-url", url, "the control network")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  relocd::text_t why{};
  why.daemon = "reloc reset";
  why.text = "asked by reloc reset";
  const auto done = relocd::CommandSmoother(
      url,
      [&](relocd::MessageBus& bus) { return bus.Publish(relocd::command_channels::kReset, why); },
      [](const relocd::localization_t& message) {
        return message.status == relocd::localization_t::UNINITIALISED;
      });
  if (done) return relocd::kExitOk;
  fmt::print(stderr, "reloc reset: {}\n", done.error().message);
  return relocd::ExitCode(done.error());
}
