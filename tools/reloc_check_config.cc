#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "config/config.h"
#include "core/exit_code.h"

// reloc check-config: whether a robot's config is right, and what it amounts to.

int main(int argc, char** argv) {
  CLI::App app("Checks a robot's config: exit 0, or 78 with file, line and the nearest key.",
               "reloc check-config");
  std::string path;
  std::vector<std::string> overrides;
  bool print = false;
  bool defaults = false;
  app.add_option("file", path, "the robot's YAML file");
  app.add_option("--set", overrides, "section.key=value, put over the file's")
      ->allow_extra_args(false);
  app.add_flag("--print", print, "print the effective config, every key");
  app.add_flag("--defaults", defaults, "print the defaults, and read no file");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (defaults) {
    fmt::print("{}", relocd::FormatConfig(relocd::Config()));
    return relocd::kExitOk;
  }
  if (path.empty()) {
    fmt::print(stderr, "reloc check-config: no file is given, must be a path or --defaults\n");
    return relocd::kExitUsage;
  }
  const auto config = relocd::LoadConfig(path, overrides);
  if (!config) {
    fmt::print(stderr, "reloc check-config: {}\n", config.error().message);
    return relocd::ExitCode(config.error());
  }
  if (print) fmt::print("{}", relocd::FormatConfig(*config));
  return relocd::kExitOk;
}
