#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "core/csv.h"
#include "core/file.h"
#include "sim_commands.h"
#include "simulation/fix_simulator.h"

namespace relocd {
namespace {

struct Options {
  std::string truth;
  std::string out;
  FixSimulationOptions fixes;
};

/// Reads `time_ns,x_m,y_m,heading_rad`, as `reloc sim wheels --truth` writes it.
Result<Trajectory2> ReadTruth(const std::string& path) {
  auto table = CsvTable::Read(path);
  if (!table) return std::move(table).error();
  auto columns = table->Columns({"time_ns", "x_m", "y_m", "heading_rad"});
  if (!columns) return std::move(columns).error();
  Trajectory2 X_WBs;
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const auto time_ns = table->Int64(row, (*columns)[0]);
    if (!time_ns) return time_ns.error();
    if (!X_WBs.empty() && *time_ns <= X_WBs.back().time_ns) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: time_ns is {}, must be above the row before's {}",
                               table->Where(row),
                               *time_ns,
                               X_WBs.back().time_ns)};
    }
    std::vector<double> cells;
    for (std::size_t i = 1; i < columns->size(); ++i) {
      const auto cell = table->Double(row, (*columns)[i]);
      if (!cell) return cell.error();
      cells.push_back(*cell);
    }
    X_WBs.push_back({.time_ns = *time_ns, .X_WB = Pose2(cells[0], cells[1], cells[2])});
  }
  if (X_WBs.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: has no rows, must have at least one", path)};
  }
  return X_WBs;
}

Result<void> WriteFixes(const Options& options) {
  const auto X_WBs = ReadTruth(options.truth);
  if (!X_WBs) return X_WBs.error();
  const auto fixes = SimulateFixes(*X_WBs, options.fixes);
  if (!fixes) return fixes.error();
  const bool has_heading = options.fixes.heading_sigma_rad > 0.0;
  const double variance = options.fixes.sigma_m * options.fixes.sigma_m;
  const double heading_variance = options.fixes.heading_sigma_rad * options.fixes.heading_sigma_rad;
  std::string text = "time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt\n";
  std::size_t outliers = 0;
  for (const SimulatedFix& fix : *fixes) {
    const std::string heading = has_heading ? fmt::format("{}", fix.X_WB.yaw()) : "";
    text += fmt::format("{},{},{},{},{},0,0,{},0,{}\n",
                        fix.time_ns,
                        fix.X_WB.x(),
                        fix.X_WB.y(),
                        heading,
                        variance,
                        variance,
                        has_heading ? heading_variance : 1.0);
    if (fix.is_outlier) ++outliers;
  }
  if (auto ok = WriteFileAtomically(options.out, text); !ok) return ok;
  fmt::print("{} fixes, {} of them outliers\n", fixes->size(), outliers);
  return {};
}

}  // namespace

void AddSimFixes(CLI::App& app, SimCommand& command) {
  const auto options = std::make_shared<Options>();  // lives as long as the parser's callback
  CLI::App& fixes = *app.add_subcommand("fixes", "what a camera finds in a map along a trajectory");
  fixes.add_option("--truth", options->truth, "the body's poses, CSV: time_ns,x_m,y_m,heading_rad")
      ->required();
  fixes.add_option("--out", options->out, "the fixes, for reloc smooth")->required();
  const auto add = [&fixes](const char* name, auto& value, const char* help) {
    fixes.add_option(name, value, help)->capture_default_str();
  };
  FixSimulationOptions& values = options->fixes;
  add("--seed", values.seed, "of all errors");
  add("--rate-hz", values.rate_hz, "of the fixes");
  add("--sigma-m", values.sigma_m, "of each coordinate; the fixes' covariance says so");
  add("--heading-sigma-rad", values.heading_sigma_rad, "0: the fixes have no heading");
  add("--outlier-share", values.outlier_share, "of fixes that are off by more");
  add("--outlier-reach-m", values.outlier_reach_m, "by up to so much");
  add("--bias-sigma-m", values.bias_sigma_m, "of an error of each coordinate that lasts");
  add("--bias-correlation-s", values.bias_correlation_s, "after so long it is down to 1/e");
  add("--mounting-yaw-rad", values.mounting_yaw_rad, "by which the headings are too far left");
  add("--time-offset-s", values.time_offset_s, "by which the times are late");
  fixes.callback([options, &command] { command = [options] { return WriteFixes(*options); }; });
}

}  // namespace relocd
