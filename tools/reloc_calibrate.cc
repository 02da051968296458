#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "calibration/drive_judgement.h"
#include "calibration/odometry_calibration.h"
#include "calibration/umbmark.h"
#include "calibration_report.h"
#include "config/config.h"
#include "core/csv.h"
#include "core/exit_code.h"
#include "core/nearest_name.h"
#include "core/parse_number.h"
#include "evaluation_input.h"
#include "geometry/planar.h"

// reloc calibrate: the numbers of a vehicle's config from a drive.

namespace relocd {
namespace {

struct Options {
  std::string config;
  std::vector<std::string> overrides;
  std::string can;
  std::string odometry;
  std::string reference;
  std::string fit = "0:1";
  std::string judge = "0:1";
  std::vector<std::string> fixed;
  std::vector<double> mount = {0.0, 0.0, 0.0};
  double spacing_s = 0.5;
  std::string plot;

  double side_m = 4.0;
  std::string runs;
};

/// A part of the time that reference and recording share.
struct Part {
  double begin = 0.0;
  double end = 1.0;
};

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

Result<Part> ParsePart(const char* option, const std::string& text) {
  const auto colon = text.find(':');
  const auto begin = ParseDouble(text.substr(0, colon));
  const auto end = ParseDouble(colon == std::string::npos ? "" : text.substr(colon + 1));
  if (!begin || !end || !(*begin >= 0.0 && *begin < *end && *end <= 1.0)) {
    return Invalid(
        fmt::format("{} is '{}', must be BEGIN:END with 0 <= BEGIN < END <= 1, parts of the drive",
                    option,
                    text));
  }
  return Part{.begin = *begin, .end = *end};
}

Result<std::vector<ReferencePose>> ReadReference(const std::string& path, std::int64_t origin_ns) {
  auto trajectory = ReadEvaluatedTrajectory(path);
  if (!trajectory) return std::move(trajectory).error();
  std::vector<ReferencePose> references;
  for (const EvaluatedPose& pose : trajectory->poses) {
    references.push_back({.time_s = 1e-9 * static_cast<double>(pose.time_ns - origin_ns),
                          .X_WR = ProjectToPlane(pose.X_WB),
                          .has_heading = pose.has_heading});
  }
  return references;
}

/// Those within a part of the time that they share with the recording.
std::vector<ReferencePose> Select(const std::vector<ReferencePose>& references,
                                  const OdometryRecording& recording,
                                  const Part& part) {
  std::vector<ReferencePose> shared;
  const double last_s = recording.samples.back().time_s;
  std::copy_if(references.begin(),
               references.end(),
               std::back_inserter(shared),
               [&](const ReferencePose& r) { return r.time_s >= 0.0 && r.time_s <= last_s; });
  if (shared.empty()) return shared;
  const double begin_s = shared.front().time_s;
  const double length_s = shared.back().time_s - begin_s;
  std::vector<ReferencePose> selected;
  std::copy_if(
      shared.begin(), shared.end(), std::back_inserter(selected), [&](const ReferencePose& r) {
        return r.time_s >= begin_s + part.begin * length_s &&
               r.time_s <= begin_s + part.end * length_s;
      });
  return selected;
}

Result<OdometryRecording> Record(const Options& options,
                                 const Config& config,
                                 const OdometryConfig& odometry) {
  if (config.can.dbc_file.empty()) {
    return Invalid(fmt::format("{}: can.dbc_file is empty, must name a DBC file", options.config));
  }
  auto dbc = DbcFile::Read(config.can.dbc_file);
  if (!dbc) return std::move(dbc).error();
  auto recorder = OdometryRecorder::Create(odometry, *dbc, config.can.messages);
  if (!recorder) return std::move(recorder).error();
  return RecordOdometry(options.can, config.can.interface, *recorder);
}

/// The motions of a file as wheels of the calibrated vehicle would have made them.
void Correct(const OdometryCalibration& calibration, OdometryRecording& recording) {
  Pose2 X_OB;
  for (std::size_t i = 1; i < recording.samples.size(); ++i) {
    const auto& from = recording.samples[i - 1].travel_m;
    const auto& to = recording.samples[i].travel_m;
    const Eigen::Vector2d travel_m(calibration.drive.left_scale * (to[0] - from[0]),
                                   calibration.drive.right_scale * (to[1] - from[1]));
    X_OB = X_OB * Pose2::Exp(BodyTwist(calibration.drive.track_m, travel_m));
    recording.X_OBs[i].X_WB = X_OB;
  }
}

Result<void> CheckOptions(const Options& options) {
  if (options.can.empty() == options.odometry.empty()) {
    return Invalid("of --can and --odometry one must be given");
  }
  const std::vector<std::string> names = CalibrationParameterNames();
  for (const std::string& name : options.fixed) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      return Invalid(fmt::format("--fix is '{}', must be one of {}", name, fmt::join(names, ", ")));
    }
  }
  if (!(options.spacing_s > 0.0 && options.spacing_s <= 60.0)) {
    return Invalid(fmt::format("--spacing-s is {}, must be in (0, 60]", options.spacing_s));
  }
  if (!std::all_of(options.mount.begin(), options.mount.end(), [](double number) {
        return std::abs(number) <= 360.0;
      })) {
    return Invalid(fmt::format("--mount is {}, must be three numbers in [-360, 360]",
                               fmt::join(options.mount, " ")));
  }
  return {};
}

Result<void> RunOdometry(const Options& options) {
  if (auto ok = CheckOptions(options); !ok) return ok;
  const auto fit = ParsePart("--fit", options.fit);
  if (!fit) return fit.error();
  const auto judge = ParsePart("--judge", options.judge);
  if (!judge) return judge.error();
  const auto config = LoadConfig(options.config, options.overrides);
  if (!config) return config.error();
  const auto before = options.can.empty()
                          ? RecordMotions(options.odometry, config->odometry.drive.track_m)
                          : Record(options, *config, config->odometry);
  if (!before) return before.error();
  if (!before->left_out.empty()) {
    fmt::print(stderr, "reloc calibrate odometry: {}\n", before->left_out);
  }
  const auto references = ReadReference(options.reference, before->origin_ns);
  if (!references) return references.error();

  OdometryCalibrationOptions calibration_options{
      .initial = {},
      .fixed = {options.fixed.begin(), options.fixed.end()},
      .spacing_s = options.spacing_s};
  calibration_options.initial.mount_x_m = options.mount[0];
  calibration_options.initial.mount_y_m = options.mount[1];
  calibration_options.initial.mount_yaw_rad = options.mount[2] * std::acos(-1.0) / 180.0;
  const auto calibration = CalibrateOdometry(
      *before, Select(*references, *before, *fit), config->odometry, calibration_options);
  if (!calibration) return Error(calibration.error()).WithContext(options.reference);
  const OdometryConfig applied = ApplyCalibration(config->odometry, *calibration);
  auto after = options.can.empty() ? before : Record(options, *config, applied);
  if (!after) return std::move(after).error();
  if (options.can.empty()) Correct(*calibration, *after);

  const auto bodies = SmoothReference(
      *before, Select(*references, *before, *judge), *calibration, options.spacing_s);
  const double offset_s = calibration->drive.time_offset_s;
  const auto was = JudgeOdometry(before->X_OBs, before->origin_ns, bodies, offset_s);
  if (!was) return Error(was.error()).WithContext(options.reference);
  const auto is = JudgeOdometry(after->X_OBs, after->origin_ns, bodies, offset_s);
  if (!is) return Error(is.error()).WithContext(options.reference);
  fmt::print("{}\n{}\n{}",
             FormatParameters(*calibration),
             FormatJudgement(*was, *is),
             FormatConfigLines(config->odometry, applied));
  return options.plot.empty() ? Result<void>() : PlotCalibration(*was, *is, options.plot);
}

constexpr const char* kUmbmarkGuide =
    "How to measure a robot by ten square runs (UMBmark, Borenstein and Feng 1996)\n\n"
    "1. Mark a corner of a square of {0} m on a flat, clean floor, with a wall or a line to "
    "measure "
    "from.\n"
    "2. Put the robot onto the corner, looking along the first side. Begin odometry anew there: "
    "start odometryd, or note x, y and yaw of ODOMETRY.\n"
    "3. By its own odometry drive {0} m and turn 90 deg to the right, four times, slowly, ending "
    "with "
    "the last turn: five runs clockwise. Then five runs with turns to the left.\n"
    "4. After each run note where the robot truly stands (true_x_m along the first side, true_y_m "
    "to "
    "its left, from the begin), and where odometry has it (odometry_x_m, odometry_y_m).\n"
    "5. Write the ten runs into a CSV file, and give it by --runs:\n\n"
    "   direction,true_x_m,true_y_m,odometry_x_m,odometry_y_m\n"
    "   clockwise,0.021,-0.034,0.002,0.001\n"
    "   counter_clockwise,-0.012,0.040,0.001,-0.002\n\n"
    "The square finds the track and how much larger one wheel is than the other; it does not find "
    "how "
    "large both are: for that drive a measured straight line.\n";

Result<std::vector<SquareRun>> ReadRuns(const std::string& path) {
  auto table = CsvTable::Read(path);
  if (!table) return std::move(table).error();
  auto columns =
      table->Columns({"direction", "true_x_m", "true_y_m", "odometry_x_m", "odometry_y_m"});
  if (!columns) return std::move(columns).error();
  std::vector<SquareRun> runs;
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const std::string& direction = table->Text(row, (*columns)[0]);
    if (direction != "clockwise" && direction != "counter_clockwise") {
      return Invalid(fmt::format("{}: direction is '{}', must be clockwise or counter_clockwise",
                                 table->Where(row),
                                 direction));
    }
    std::vector<double> cells;
    for (std::size_t i = 1; i < columns->size(); ++i) {
      auto cell = table->Double(row, (*columns)[i]);
      if (!cell) return std::move(cell).error();
      cells.push_back(*cell);
    }
    runs.push_back({.clockwise = direction == "clockwise",
                    .error_m = {cells[0] - cells[2], cells[1] - cells[3]}});
  }
  return runs;
}

Result<void> RunUmbmark(const Options& options) {
  if (!(options.side_m > 0.0 && options.side_m <= 1000.0)) {
    return Invalid(fmt::format("--side-m is {}, must be in (0, 1000]", options.side_m));
  }
  if (options.runs.empty()) {
    fmt::print(fmt::runtime(kUmbmarkGuide), options.side_m);
    return {};
  }
  const auto config = LoadConfig(options.config, options.overrides);
  if (!config) return config.error();
  const auto runs = ReadRuns(options.runs);
  if (!runs) return runs.error();
  const auto umbmark = EvaluateUmbmark(*runs, options.side_m, config->odometry.drive.track_m);
  if (!umbmark) return Error(umbmark.error()).WithContext(options.runs);
  fmt::print("{}", FormatUmbmark(*umbmark, config->odometry));
  return {};
}

void AddConfig(CLI::App& app, Options& options) {
  app.add_option("--config", options.config, "the vehicle's YAML file: can, odometry");
  app.add_option("--set", options.overrides, "section.key=value, put over the file's")
      ->allow_extra_args(false);
}

CLI::App& AddOdometry(CLI::App& app, Options& options) {
  CLI::App& odometry =
      *app.add_subcommand("odometry", "wheels, track, yaw rate, steering from a drive");
  AddConfig(odometry, options);
  odometry.get_option("--config")->required();
  odometry.add_option("--can", options.can, "what candump -L wrote of the drive");
  odometry.add_option(
      "--odometry", options.odometry, "or its motions: time_ns,dx_m,dy_m,dtheta_rad");
  odometry
      .add_option("--reference",
                  options.reference,
                  "where it truly was: TUM, or CSV with time_ns, time_s or t_s, x_m, y_m and, if "
                  "known, heading_rad; on the log's clock to a fifth of a second")
      ->required();
  odometry.add_option("--fit", options.fit, "BEGIN:END, the part of the drive to learn from")
      ->capture_default_str();
  odometry
      .add_option("--judge", options.judge, "BEGIN:END, the part to compare before and after on")
      ->capture_default_str();
  odometry.add_option("--fix", options.fixed, "keep this parameter; may be repeated")
      ->allow_extra_args(false);
  odometry
      .add_option("--mount", options.mount, "the reference on the body: x m forward, y m left, deg")
      ->expected(3);
  odometry
      .add_option(
          "--spacing-s", options.spacing_s, "between two poses of the reference that are used")
      ->capture_default_str();
  odometry.add_option("--plot", options.plot, "a PNG of the drive from above, before and after");
  return odometry;
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  CLI::App app(
      "The numbers of a vehicle's config from a drive, with their standard deviations.\n\n"
      "odometry finds each wheel's radius or scale, the track, bias and scale of the yaw-rate "
      "sensor, "
      "ratio and offset of the steering, how well they measure, the time between CAN bus and "
      "reference, and where the reference is mounted. What a drive does not tell is named and "
      "kept. "
      "umbmark explains and evaluates ten square runs, which need no reference but a tape measure. "
      "Both end with the lines to paste into the config. docs/calibration.md says which drives are "
      "good.",
      "reloc calibrate");
  app.require_subcommand(1);
  relocd::Options options;
  CLI::App& odometry = relocd::AddOdometry(app, options);
  CLI::App& umbmark = *app.add_subcommand("umbmark", "track and wheels from ten square runs");
  relocd::AddConfig(umbmark, options);
  umbmark.add_option("--side-m", options.side_m, "of the square")->capture_default_str();
  umbmark
      .add_option("--runs", options.runs, "CSV of the runs; without it: how to drive and note them")
      ->needs(umbmark.get_option("--config"));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  const auto ok = odometry.parsed() ? relocd::RunOdometry(options) : relocd::RunUmbmark(options);
  if (!ok) {
    fmt::print(stderr,
               "reloc calibrate {}: {}\n",
               odometry.parsed() ? "odometry" : "umbmark",
               ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
