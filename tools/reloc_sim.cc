#include <cstdio>
#include <span>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "core/exit_code.h"
#include "sim_commands.h"

// reloc sim: sensors of a robot that is not there.

int main(int argc, char** argv) {
  CLI::App app("A drive through a simulated world: images, CAN frames, and the truth.",
               "reloc sim");
  app.require_subcommand(0, 1);
  relocd::SimCommand command;
  std::string command_line = "reloc sim";
  for (const char* const argument : std::span(argv, static_cast<std::size_t>(argc)).subspan(1))
    command_line += fmt::format(" {}", argument);
  relocd::AddSimDrive(app, command_line, command);
  relocd::AddSimAgain(app, command);
  relocd::AddSimWheels(app, command);
  relocd::AddSimFixes(app, command);
  relocd::AddSimPlay(app, command);
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
