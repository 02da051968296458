#pragma once

#include <optional>
#include <string>
#include <vector>

namespace relocd {

struct DaemonInfo {
  std::string name;             ///< "odometryd"
  std::string description;      ///< For --help.
  bool uses_images = false;     ///< Opens the image network too.
  std::string instance_option;  ///< "camera" adds a required --camera NAME; the daemon is then
                                ///< called name_NAME.
};

/// What the command line of a daemon says.
struct DaemonOptions {
  std::string config_path = "/etc/relocd/robot.yaml";
  std::vector<std::string> overrides;  ///< `section.key=value`, put over the config's.
  bool check_config = false;
  bool print_config = false;
  std::string instance;  ///< Of DaemonInfo::instance_option.
};

/// Reads --config, --set, --check-config, --print-config, --lcm-url, --image-lcm-url, --version and
/// --help.
///
/// @return an exit code when the process is to end here.
std::optional<int> ParseCommandLine(int argc,
                                    char** argv,
                                    const DaemonInfo& info,
                                    DaemonOptions& options);

}  // namespace relocd
