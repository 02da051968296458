#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/config.h"
#include "system_probes.h"

namespace relocd {

/// One thing that was looked at.
struct Finding {
  std::string name;  ///< As in `lcm route`.
  bool is_ok = false;
  std::string found;    ///< What is so, with the value, and what is needed where it is not ok.
  std::string command;  ///< That mends it; empty when it is ok.
};

/// What the shipped units and accounts are called.
inline constexpr std::string_view kServiceUnit = "relocd.service";
inline constexpr std::string_view kServiceUser = "relocd";

/// Looks at the machine as the config needs it: one finding a check, the same checks each time for
/// the same config. Asks only for what does not change the machine.
std::vector<Finding> Examine(const Config& config,
                             const std::string& config_path,
                             SystemProbes& probes);

[[nodiscard]] bool IsAllOk(const std::vector<Finding>& findings);

/// One line each, for people: what is not ok ends with the command.
std::string FormatFindings(const std::vector<Finding>& findings);

/// For scripts: {"ok": ..., "checks": [{"name", "ok", "found", "command"}]}.
std::string FormatFindingsAsJson(const std::vector<Finding>& findings);

}  // namespace relocd
