#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "core/result.h"

namespace relocd {

/// What `reloc sim` is to do, known once the command line is read.
using SimCommand = std::function<Result<void>()>;

/// Each of these makes the parser set `command`, which must outlive it.

/// What `reloc sim` does without a subcommand: a drive through a world.
///
/// @param command_line  of this run, to be kept with its results.
void AddSimDrive(CLI::App& app, const std::string& command_line, SimCommand& command);

/// `again`: some places of a drive, as another session has them.
void AddSimAgain(CLI::App& app, SimCommand& command);

/// `wheels`: the CAN frames of the wheels along a trajectory from a file.
void AddSimWheels(CLI::App& app, SimCommand& command);

/// `fixes`: what a camera finds in a map along a trajectory from a file.
void AddSimFixes(CLI::App& app, SimCommand& command);

/// `play`: a recorded drive on the devices of a robot, on the wall clock.
void AddSimPlay(CLI::App& app, SimCommand& command);

/// `view`: one picture of a world, from the road or from above.
void AddSimView(CLI::App& app, SimCommand& command);

}  // namespace relocd
