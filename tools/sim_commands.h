#pragma once

#include <functional>

#include <CLI/CLI.hpp>

#include "core/result.h"

namespace relocd {

/// What `reloc sim` is to do, known once the command line is read.
using SimCommand = std::function<Result<void>()>;

/// Each of these adds a subcommand of `reloc sim`, which sets `command` when it is chosen. Both
/// arguments must outlive the parsing.

/// `wheels`: the CAN frames of the wheels along a trajectory from a file.
void AddSimWheels(CLI::App& app, SimCommand& command);

/// `view`: one picture of a world, from the road or from above.
void AddSimView(CLI::App& app, SimCommand& command);

}  // namespace relocd
