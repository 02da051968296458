#include "daemon/daemon_options.h"

#include <CLI/CLI.hpp>

#include "core/exit_code.h"

namespace relocd {

std::optional<int> ParseCommandLine(int argc,
                                    char** argv,
                                    const DaemonInfo& info,
                                    DaemonOptions& options) {
  CLI::App app(info.description, info.name);
  std::string control_url;
  std::string image_url;
  app.add_option("--config", options.config_path, "the robot's YAML file")->capture_default_str();
  app.add_option("--set", options.overrides, "section.key=value, put over the file's")
      ->allow_extra_args(false);
  app.add_flag("--check-config", options.check_config, "only check the config: exit 0, or 78");
  app.add_flag("--print-config", options.print_config, "print the effective config, every key");
  app.add_option("--lcm-url", control_url, "put over bus.control_url");
  app.add_option("--image-lcm-url", image_url, "put over bus.image_url");
  app.set_version_flag("--version", info.name + " " RELOCD_VERSION);
  if (!info.instance_option.empty()) {
    app.add_option("--" + info.instance_option, options.instance, "which of the config's")
        ->required();
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  }
  if (!control_url.empty()) options.overrides.push_back("bus.control_url=" + control_url);
  if (!image_url.empty()) options.overrides.push_back("bus.image_url=" + image_url);
  return std::nullopt;
}

}  // namespace relocd
