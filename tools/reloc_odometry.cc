#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "can/candump_log.h"
#include "config/config.h"
#include "core/exit_code.h"
#include "core/file.h"
#include "odometry/wheel_odometry.h"

// reloc odometry: a recorded CAN bus to the motion of the body, with odometryd's own code.

namespace relocd {
namespace {

struct Options {
  std::string config;
  std::vector<std::string> overrides;
  std::string can;
  std::string out;
  std::string signals;
  bool json = false;
};

/// What is said of a whole log.
struct Summary {
  std::int64_t increments = 0;
  std::int64_t flagged = 0;
  double distance_m = 0.0;
  std::optional<MonotonicTime> begin{};
  OdometryIncrement last{};
};

std::string OdometryHeader() {
  return "time_ns,dx_m,dy_m,dtheta_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt\n";
}

void AppendOdometry(const OdometryIncrement& increment, std::string& text) {
  const Pose2& X = increment.X_BiBj;
  const Eigen::Matrix3d& covariance = increment.covariance;
  text += fmt::format("{},{},{},{},{},{},{},{},{},{}\n",
                      ToNanoseconds(increment.time),
                      X.x(),
                      X.y(),
                      X.yaw(),
                      covariance(0, 0),
                      covariance(0, 1),
                      covariance(0, 2),
                      covariance(1, 1),
                      covariance(1, 2),
                      covariance(2, 2));
}

std::string SignalsHeader(const WheelSignals& signals) {
  if (signals.are_ticks()) return "time_ns,left_ticks,right_ticks\n";
  return signals.has_front() ? "time_ns,left_mps,right_mps,front_left_mps,front_right_mps\n"
                             : "time_ns,left_mps,right_mps\n";
}

void AppendSignals(const WheelSignals& signals, const WheelSample& sample, std::string& text) {
  text += fmt::format("{}", ToNanoseconds(sample.time));
  if (signals.are_ticks()) {
    text += fmt::format(",{},{}", sample.ticks[0], sample.ticks[1]);
  } else {
    text += fmt::format(",{},{}", sample.speeds_mps[0], sample.speeds_mps[1]);
  }
  if (signals.has_front()) {
    text += fmt::format(",{},{}", sample.front_speeds_mps[0], sample.front_speeds_mps[1]);
  }
  text += '\n';
}

void Add(const OdometryIncrement& increment, Summary& summary) {
  ++summary.increments;
  if (increment.flags != 0) ++summary.flagged;
  summary.distance_m += increment.X_BiBj.translation().norm();
  if (!summary.begin) summary.begin = increment.time;
  summary.last = increment;
}

void Print(const Summary& summary, const WheelOdometry& odometry, bool json) {
  const WheelOdometry::Counters& counts = odometry.counters();
  const MessageGuard::Counters frames = odometry.frame_counters();
  const double duration_s = summary.begin ? ToSeconds(summary.last.time - *summary.begin) : 0.0;
  const Pose2& X_OB = summary.last.X_OB;
  if (json) {
    fmt::print(
        "{{\"samples\": {}, \"increments\": {}, \"flagged\": {}, \"duration_s\": {:.6f}, "
        "\"distance_m\": {:.6f}, \"x_OB_m\": {:.6f}, \"y_OB_m\": {:.6f}, \"yaw_OB_rad\": {:.6f}, "
        "\"gaps\": {}, \"jumps\": {}, \"slips\": {}, \"out_of_order\": {}, \"bad_checksums\": {}, "
        "\"stuck_counters\": {}, \"short_frames\": {}, \"missing_frames\": {}, "
        "\"non_finite_values\": {}}}\n",
        counts.samples,
        summary.increments,
        summary.flagged,
        duration_s,
        summary.distance_m,
        X_OB.x(),
        X_OB.y(),
        X_OB.yaw(),
        counts.gaps,
        counts.jumps,
        counts.slips,
        counts.out_of_order,
        frames.bad_checksums,
        frames.stuck_counters,
        frames.short_frames,
        frames.missing_frames,
        frames.non_finite);
    return;
  }
  fmt::print(
      "{} sets of wheel measurements in {:.3f} s: {:.1f} m, end at x {:.2f} m, y {:.2f} m, yaw "
      "{:.4f} rad\n",
      counts.samples,
      duration_s,
      summary.distance_m,
      X_OB.x(),
      X_OB.y(),
      X_OB.yaw());
  fmt::print(
      "flagged {} of {}: gaps {}, slips {}; refused: jumps {}, out of order {}, bad checksums {}, "
      "stuck counters {}, short frames {}, values that are not finite {}; missing {}\n",
      summary.flagged,
      summary.increments,
      counts.gaps,
      counts.slips,
      counts.jumps,
      counts.out_of_order,
      frames.bad_checksums,
      frames.stuck_counters,
      frames.short_frames,
      frames.non_finite,
      frames.missing_frames);
}

/// Both tables of a log, and its summary.
struct Tables {
  std::string odometry;
  std::string signals;
  Summary summary{};
};

Result<Tables> Process(const Options& options,
                       const std::string& interface,
                       WheelOdometry& odometry) {
  auto log = CandumpLog::Open(options.can);
  if (!log) return std::move(log).error();
  Tables tables{.odometry = OdometryHeader(), .signals = SignalsHeader(odometry.signals())};
  while (true) {
    auto frame = log->NextDataFrame(interface);
    if (!frame) return std::move(frame).error();
    if (!frame->has_value()) break;
    const auto increment = odometry.Handle(**frame);
    if (odometry.last_sample()) {
      AppendSignals(odometry.signals(), *odometry.last_sample(), tables.signals);
    }
    if (!increment) continue;
    AppendOdometry(*increment, tables.odometry);
    Add(*increment, tables.summary);
  }
  if (const std::string left_out = log->LeftOut(); !left_out.empty()) {
    fmt::print(stderr, "reloc odometry: {}\n", left_out);
  }
  if (tables.summary.increments == 0) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: has no wheel measurement on {}, must have the frames of the DBC "
                             "file's wheel signals",
                             options.can,
                             interface)};
  }
  return tables;
}

Result<void> Run(const Options& options) {
  auto config = LoadConfig(options.config, options.overrides);
  if (!config) return std::move(config).error();
  if (config->can.dbc_file.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: can.dbc_file is empty, must name a DBC file", options.config)};
  }
  auto dbc = DbcFile::Read(config->can.dbc_file);
  if (!dbc) return std::move(dbc).error();
  auto odometry = WheelOdometry::Create(config->odometry, *dbc, config->can.messages);
  if (!odometry) return std::move(odometry).error();
  auto tables = Process(options, config->can.interface, *odometry);
  if (!tables) return std::move(tables).error();
  if (!options.out.empty()) {
    if (auto ok = WriteFileAtomically(options.out, tables->odometry); !ok) return ok;
  }
  if (!options.signals.empty()) {
    if (auto ok = WriteFileAtomically(options.signals, tables->signals); !ok) return ok;
  }
  Print(tables->summary, *odometry, options.json);
  return {};
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  CLI::App app("A recorded CAN bus to the motion of the body, with odometryd's own code.",
               "reloc odometry");
  relocd::Options options;
  app.add_option("--config", options.config, "the robot's or vehicle's YAML file: can, odometry")
      ->required();
  app.add_option("--set", options.overrides, "section.key=value, put over the file's")
      ->allow_extra_args(false);
  app.add_option("--can", options.can, "what candump -L wrote")->required();
  app.add_option("--out", options.out, "the motions as CSV, one row for each set of measurements");
  app.add_option("--signals", options.signals, "the decoded wheel signals as CSV");
  app.add_flag("--json", options.json, "the summary for scripts");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (auto ok = relocd::Run(options); !ok) {
    fmt::print(stderr, "reloc odometry: {}\n", ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
