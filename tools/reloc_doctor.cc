#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "config/config.h"
#include "core/exit_code.h"
#include "doctor.h"
#include "system_probes.h"

// reloc doctor: whether the machine is as the config needs it, and the command that mends it.

int main(int argc, char** argv) {
  CLI::App app(
      "Checks the machine and the config, one line a check, with the command that mends what is "
      "wrong: exit 0 when all is well, 1 when something is not, 78 when the config is wrong.",
      "reloc doctor");
  std::string path = "/etc/relocd/robot.yaml";
  std::vector<std::string> overrides;
  bool json = false;
  app.add_option("--config", path, "the robot's YAML file")->capture_default_str();
  app.add_option("--set", overrides, "section.key=value, put over the file's")
      ->allow_extra_args(false);
  app.add_flag("--json", json, "for scripts");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  std::vector<relocd::Finding> findings;
  const auto config = relocd::LoadConfig(path, overrides);
  int exit_code = relocd::kExitOk;
  if (config) {
    relocd::ThisMachine machine;
    findings = relocd::Examine(*config, path, machine);
    if (!relocd::IsAllOk(findings)) exit_code = relocd::kExitFailure;
  } else {
    findings = {{.name = "config",
                 .is_ok = false,
                 .found = config.error().message,
                 .command = "sudoedit " + path + " && reloc check-config " + path}};
    exit_code = relocd::ExitCode(config.error());
  }
  fmt::print("{}",
             json ? relocd::FormatFindingsAsJson(findings) : relocd::FormatFindings(findings));
  return exit_code;
}
