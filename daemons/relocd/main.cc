#include <cstdio>
#include <utility>

#include <fmt/core.h>

#include "relocd/relocd.h"

#include "core/exit_code.h"
#include "daemon/daemon.h"
#include "daemon/daemon_options.h"

int main(int argc, char** argv) {
  using relocd::LogLine;
  constexpr int kError = 3;
  const relocd::DaemonInfo info{.name = "relocd",
                                .description = "Starts, watches and restarts relocd's daemons.",
                                .uses_images = false,
                                .instance_option = ""};
  relocd::DaemonOptions options;
  if (const auto exit_code = relocd::ParseCommandLine(argc, argv, info, options)) {
    return *exit_code;
  }
  auto config = relocd::LoadConfig(options.config_path, options.overrides);
  if (!config) {
    LogLine(kError, info.name, config.error().message);
    return relocd::ExitCode(config.error());
  }
  if (options.print_config) fmt::print("{}", relocd::FormatConfig(*config));
  if (options.check_config || options.print_config) return relocd::kExitOk;

  relocd::Relocd daemon(std::move(config).value(), std::move(options));
  if (auto ok = daemon.Run(); !ok) {
    LogLine(kError, info.name, ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
