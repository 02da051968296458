#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "config/config.h"
#include "core/exit_code.h"
#include "core/file.h"
#include "smoothing/motion_log_csv.h"
#include "smoothing/offline_smoother.h"

// reloc smooth: recorded odometry and fixes to the pose, with smootherd's own code.

namespace relocd {
namespace {

struct Options {
  std::string odometry;
  std::string fixes;
  std::string out;
  std::string config;
  std::vector<std::string> overrides;
  std::string window_keyframes;
  bool smoothed = false;
};

Result<SmootherConfig> ReadConfig(const Options& options) {
  std::vector<std::string> overrides = options.overrides;
  if (!options.window_keyframes.empty()) {
    overrides.push_back("localization.smoother.window_keyframes=" + options.window_keyframes);
  }
  const auto config = LoadConfig(options.config, overrides);
  if (!config) return config.error();
  return config->localization.smoother;
}

void Report(const MotionLog& log, const std::vector<SmootherEstimate>& estimates) {
  std::map<std::string, int> rows;
  for (const SmootherEstimate& estimate : estimates)
    ++rows[ToString(estimate.status)];
  fmt::print(stderr, "{} steps of odometry, {} fixes:", log.odometry.size(), log.fixes.size());
  for (const auto& [status, count] : rows)
    fmt::print(stderr, " {} {}", count, status);
  fmt::print(stderr, "\n");
}

Result<void> Run(const Options& options) {
  const auto config = ReadConfig(options);
  if (!config) return config.error();
  const auto log = ReadMotionLog(options.odometry, options.fixes, *config);
  if (!log) return log.error();
  SystematicErrors errors;
  const std::vector<SmootherEstimate> estimates =
      options.smoothed ? SmoothAll(*log, *config, &errors) : SmoothCausally(*log, *config, &errors);
  Report(*log, estimates);
  fmt::print(stderr, "{}", Describe(errors));
  const std::string text = FormatEstimatesCsv(estimates);
  if (options.out.empty()) {
    fmt::print("{}", text);
    return {};
  }
  return WriteFileAtomically(options.out, text);
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  CLI::App app("Recorded odometry and fixes to the pose, with smootherd's own code.",
               "reloc smooth");
  relocd::Options options;
  app.add_option("--odometry", options.odometry, "CSV: time_ns,dx_m,dy_m,dtheta_rad[,cov_xx,...]")
      ->required();
  app.add_option("--fixes", options.fixes, "CSV: time_ns,x_m,y_m[,heading_rad[,cov_xx,...]]")
      ->required();
  app.add_option("--out", options.out, "the estimates as CSV, one row for each fix; else stdout");
  app.add_flag("--smoothed",
               options.smoothed,
               "each row from the whole log; else from what had arrived by then");
  app.add_option("--window",
                 options.window_keyframes,
                 "poses kept and re-estimated, instead of the config's window_keyframes");
  app.add_option(
      "--config", options.config, "the robot's YAML file: localization; else the defaults");
  app.add_option("--set",
                 options.overrides,
                 "section.key=value, put over the config's: as localization.smoother.ok_sigma_m=1")
      ->allow_extra_args(false);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (auto ok = relocd::Run(options); !ok) {
    fmt::print(stderr, "reloc smooth: {}\n", ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
