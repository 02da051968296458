#include <cstdio>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "core/exit_code.h"
#include "sim_commands.h"

// reloc sim: sensors of a robot that is not there.

int main(int argc, char** argv) {
  CLI::App app("Simulated sensors.", "reloc sim");
  app.require_subcommand(1);
  relocd::SimCommand command;
  relocd::AddSimWheels(app, command);
  relocd::AddSimView(app, command);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (auto ok = command(); !ok) {
    fmt::print(stderr, "reloc sim: {}\n", ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
