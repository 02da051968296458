#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "can/candump_log.h"
#include "config/config.h"
#include "core/csv.h"
#include "core/file.h"
#include "sim_commands.h"
#include "simulation/wheel_simulator.h"

namespace relocd {
namespace {

struct Options {
  std::string trajectory;
  double camera_forward_m = 0.0;
  double begin_s = 0.0;
  double end_s = std::numeric_limits<double>::infinity();
  std::string config;
  std::string out;
  std::string truth;
  WheelSimulationOptions wheels;
};

/// Reads `t_s,x_m,y_m,theta_rad`, planar poses of the camera, and gives those of the body.
Result<Trajectory2> ReadBodyTrajectory(const Options& options) {
  auto table = CsvTable::Read(options.trajectory);
  if (!table) return std::move(table).error();
  auto columns = table->Columns({"t_s", "x_m", "y_m", "theta_rad"});
  if (!columns) return std::move(columns).error();
  const Pose2 X_CB(-options.camera_forward_m, 0.0, 0.0);
  Trajectory2 X_WBs;
  double last_s = -std::numeric_limits<double>::infinity();
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    std::vector<double> cells;
    for (const std::size_t column : *columns) {
      auto cell = table->Double(row, column);
      if (!cell) return std::move(cell).error();
      cells.push_back(*cell);
    }
    if (!(cells[0] > last_s) || std::abs(cells[0]) > 1e9) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: t_s is {} after {}, must increase, and be below 1e9",
                               table->Where(row),
                               cells[0],
                               last_s)};
    }
    last_s = cells[0];
    if (last_s < options.begin_s || last_s > options.end_s) continue;
    X_WBs.push_back({.time_ns = std::llround(cells[0] * 1e9),
                     .X_WB = Pose2(cells[1], cells[2], cells[3]) * X_CB});
  }
  return X_WBs;
}

Result<void> WriteDrive(const Options& options, const SimulatedDrive& drive) {
  std::string log;
  for (const CandumpRecord& record : drive.frames)
    log += FormatCandumpLine(record) + '\n';
  if (auto ok = WriteFileAtomically(options.out, log); !ok) return ok;
  if (options.truth.empty()) return {};
  std::string truth = "time_ns,x_m,y_m,heading_rad\n";
  for (const TimedPose2& pose : drive.X_WBs) {
    truth +=
        fmt::format("{},{},{},{}\n", pose.time_ns, pose.X_WB.x(), pose.X_WB.y(), pose.X_WB.yaw());
  }
  return WriteFileAtomically(options.truth, truth);
}

Result<void> CheckOptions(const Options& options) {
  if (!(std::abs(options.camera_forward_m) <= 100.0)) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("--camera-forward-m is {}, must be in [-100, 100]", options.camera_forward_m)};
  }
  if (!(options.begin_s < options.end_s)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("--begin-s is {} and --end-s {}, must be a time and a later one",
                             options.begin_s,
                             options.end_s)};
  }
  return {};
}

Result<void> SimulateDrive(Options options) {
  if (auto ok = CheckOptions(options); !ok) return ok;
  auto config = LoadConfig(options.config, {});
  if (!config) return std::move(config).error();
  if (config->can.dbc_file.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: can.dbc_file is empty, must name a DBC file", options.config)};
  }
  auto dbc = DbcFile::Read(config->can.dbc_file);
  if (!dbc) return std::move(dbc).error();
  auto X_WBs = ReadBodyTrajectory(options);
  if (!X_WBs) return std::move(X_WBs).error();
  options.wheels.interface = config->can.interface;
  auto drive = SimulateWheels(*X_WBs, config->odometry, *dbc, options.wheels);
  if (!drive) return std::move(drive).error().WithContext(options.trajectory);
  if (auto ok = WriteDrive(options, *drive); !ok) return ok;
  fmt::print(
      "{} frames in {:.3f} s\n",
      drive->frames.size(),
      static_cast<double>(drive->X_WBs.back().time_ns - drive->X_WBs.front().time_ns) * 1e-9);
  return {};
}

void AddWheelsOptions(CLI::App& wheels, Options& options) {
  wheels
      .add_option("--trajectory", options.trajectory, "planar camera poses: t_s,x_m,y_m,theta_rad")
      ->required();
  wheels.add_option(
      "--camera-forward-m", options.camera_forward_m, "of the camera before the body");
  wheels.add_option("--begin-s", options.begin_s, "leave out what is before");
  wheels.add_option("--end-s", options.end_s, "leave out what is after");
  wheels.add_option("--config", options.config, "the vehicle's YAML file: can, odometry")
      ->required();
  wheels.add_option("--out", options.out, "the candump log")->required();
  wheels.add_option("--truth", options.truth, "the body's poses at the frames' times, as CSV");
  wheels.add_option("--seed", options.wheels.seed, "of all noise")->capture_default_str();
  wheels.add_option("--rate-hz", options.wheels.rate_hz, "of the frames")->capture_default_str();
  wheels.add_option("--radius-sigma", options.wheels.radius_sigma, "of the wheels' radii, as part")
      ->capture_default_str();
  wheels
      .add_option("--wheel-sigma",
                  options.wheels.wheel_sigma_m_per_sqrt_m,
                  "of a wheel's travel after one metre, m; negative: as the config has it")
      ->capture_default_str();
  wheels.add_option("--slips-per-m", options.wheels.slips_per_m, "of each wheel")
      ->capture_default_str();
  wheels.add_option("--slip-sigma-m", options.wheels.slip_sigma_m, "of one slip")
      ->capture_default_str();
}

}  // namespace

void AddSimWheels(CLI::App& app, SimCommand& command) {
  const auto options = std::make_shared<Options>();  // lives as long as the parser's callback
  CLI::App& wheels =
      *app.add_subcommand("wheels", "the CAN frames of the wheels along a trajectory");
  AddWheelsOptions(wheels, *options);
  wheels.callback([options, &command] { command = [options] { return SimulateDrive(*options); }; });
}

}  // namespace relocd
