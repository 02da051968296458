#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "core/csv.h"
#include "core/exit_code.h"
#include "core/file.h"
#include "core/parse_number.h"
#include "geometry/planar.h"
#include "geometry/trajectory.h"

// reloc import: public data sets into the layouts that our tools read.

namespace relocd {
namespace {

struct NcltOptions {
  std::string frames;
  std::string odometry;
  std::string out_dir;
};

constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;

/// The cells of a row, as numbers.
Result<std::vector<double>> Numbers(const CsvTable& table,
                                    std::size_t row,
                                    const std::vector<std::size_t>& columns) {
  std::vector<double> numbers;
  for (const std::size_t column : columns) {
    auto number = table.Double(row, column);
    if (!number) return std::move(number).error();
    numbers.push_back(*number);
  }
  return numbers;
}

/// The rows' times, which must increase.
Result<std::vector<std::int64_t>> Times(const CsvTable& table) {
  const auto column = table.Columns({"timestamp_us"});
  if (!column) return column.error();
  std::vector<std::int64_t> times;
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    const auto time_us = table.Int64(row, column->front());
    if (!time_us) return time_us.error();
    if (!times.empty() && *time_us * kNanosecondsPerMicrosecond <= times.back()) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: timestamp_us is {}, must be above the row before's",
                               table.Where(row),
                               *time_us)};
    }
    times.push_back(*time_us * kNanosecondsPerMicrosecond);
  }
  if (times.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: has no rows, must have at least one", table.path())};
  }
  return times;
}

/// The texts of the files that the frames become.
struct NcltFrames {
  std::vector<std::int64_t> times_ns;
  std::string fixes = "time_ns,x_m,y_m\n";
  std::string truth = "time_ns,x_m,y_m,heading_rad\n";
  std::string released = "time_ns,x_m,y_m\n";
  Trajectory3 truth_tum;
};

Result<NcltFrames> ReadFrames(const std::string& path) {
  const auto table = CsvTable::Read(path);
  if (!table) return table.error();
  const auto columns =
      table->Columns({"gt_x", "gt_y", "gt_heading", "pred_x", "pred_y", "gtsam_x", "gtsam_y"});
  if (!columns) return columns.error();
  auto times = Times(*table);
  if (!times) return std::move(times).error();
  NcltFrames frames;
  frames.times_ns = std::move(times).value();
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const auto numbers = Numbers(*table, row, *columns);
    if (!numbers) return numbers.error();
    const std::vector<double>& n = *numbers;
    const std::int64_t time_ns = frames.times_ns[row];
    frames.truth += fmt::format("{},{},{},{}\n", time_ns, n[0], n[1], n[2]);
    frames.fixes += fmt::format("{},{},{}\n", time_ns, n[3], n[4]);
    frames.released += fmt::format("{},{},{}\n", time_ns, n[5], n[6]);
    frames.truth_tum.push_back(
        {.time_ns = time_ns, .X_WB = LiftFromPlane(Pose2(n[0], n[1], n[2]))});
  }
  return frames;
}

/// The odometry around the frames: the session goes on for an hour and a half.
Result<std::string> ReadOdometry(const std::string& path,
                                 const std::vector<std::int64_t>& frame_times_ns) {
  const auto table = CsvTable::Read(path);
  if (!table) return table.error();
  const auto columns = table->Columns({"dx", "dy", "dtheta"});
  if (!columns) return columns.error();
  const auto times = Times(*table);
  if (!times) return times.error();
  constexpr std::int64_t kMargin = 1'000'000'000;
  std::string text = "time_ns,dx_m,dy_m,dtheta_rad\n";
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const std::int64_t time_ns = (*times)[row];
    if (time_ns < frame_times_ns.front() - kMargin) continue;
    if (time_ns > frame_times_ns.back() + kMargin) break;
    const auto numbers = Numbers(*table, row, *columns);
    if (!numbers) return numbers.error();
    text += fmt::format("{},{},{},{}\n", time_ns, (*numbers)[0], (*numbers)[1], (*numbers)[2]);
  }
  return text;
}

Result<void> ImportNclt(const NcltOptions& options) {
  const auto frames = ReadFrames(options.frames);
  if (!frames) return frames.error();
  const auto odometry = ReadOdometry(options.odometry, frames->times_ns);
  if (!odometry) return odometry.error();
  std::error_code no_folder;  // then the first write says so
  std::filesystem::create_directories(options.out_dir, no_folder);
  const std::vector<std::pair<std::string, std::string>> files{
      {"odo.csv", *odometry},
      {"fixes.csv", frames->fixes},
      {"truth.csv", frames->truth},
      {"truth_tum.txt", FormatTumTrajectory(frames->truth_tum)},
      {"released.csv", frames->released}};
  for (const auto& [name, text] : files) {
    const std::string path = options.out_dir + "/" + name;
    if (auto ok = WriteFileAtomically(path, text); !ok) return ok;
    fmt::print("{}\n", path);
  }
  return {};
}

struct KittiOptions {
  std::string poses;
  std::string out;
  double rate_hz = 10.0;
};

constexpr std::size_t kKittiNumbers = 12;

/// The numbers of a line of KITTI's poses: a 3x4 matrix, camera to world, row by row.
Result<std::vector<double>> KittiNumbers(std::string_view line, const std::string& where) {
  std::vector<double> numbers;
  for (line = Trim(line); !line.empty();) {
    const std::size_t end = std::min(line.find(' '), line.size());
    const auto number = ParseDouble(line.substr(0, end));
    if (!number || !std::isfinite(*number)) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: '{}' is no finite number", where, line.substr(0, end))};
    }
    numbers.push_back(*number);
    line = Trim(line.substr(end));
  }
  if (numbers.size() == kKittiNumbers) return numbers;
  return Error{
      ErrorKind::kInvalidInput,
      fmt::format("{}: has {} numbers, must have {}", where, numbers.size(), kKittiNumbers)};
}

/// Whether they are of another layout: the third column is an axis of the camera.
Result<void> CheckKittiAxis(const std::vector<double>& numbers, const std::string& where) {
  constexpr double kTolerance = 1e-3;
  const double length = std::hypot(numbers[2], numbers[6], numbers[10]);
  if (std::abs(length - 1.0) < kTolerance) return {};
  return Error{ErrorKind::kInvalidInput,
               fmt::format("{}: the camera's axis ({}, {}, {}) has the length {}, must have 1",
                           where,
                           numbers[2],
                           numbers[6],
                           numbers[10],
                           length)};
}

/// The path in the ground plane: the camera looks along z, x is to its right.
Result<void> ImportKitti(const KittiOptions& options) {
  if (!(options.rate_hz > 0.0 && std::isfinite(options.rate_hz))) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("--rate-hz is {}, must be > 0 and finite", options.rate_hz)};
  }
  const auto text = ReadFile(options.poses);
  if (!text) return text.error();
  if (Trim(*text).empty()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: has no lines, must have at least one", options.poses)};
  }
  std::string out = "t_s,x_m,y_m,theta_rad\n";
  std::string_view rest = *text;
  for (int row = 0; !rest.empty(); ++row) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string where = fmt::format("{}: line {}", options.poses, row + 1);
    const auto numbers = KittiNumbers(rest.substr(0, end), where);
    if (!numbers) return numbers.error();
    if (auto ok = CheckKittiAxis(*numbers, where); !ok) return ok;
    const std::vector<double>& n = *numbers;
    out +=
        fmt::format("{},{},{},{}\n", row / options.rate_hz, n[11], -n[3], std::atan2(-n[2], n[10]));
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return WriteFileAtomically(options.out, out);
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  CLI::App app("Public data sets into the layouts that our tools read.", "reloc import");
  app.require_subcommand(1);
  relocd::NcltOptions nclt;
  auto* nclt_command = app.add_subcommand(
      "nclt",
      "positions that a network predicted on NCLT: odo.csv, fixes.csv, truth.csv, truth_tum.txt, "
      "released.csv");
  nclt_command
      ->add_option("--frames",
                   nclt.frames,
                   "CSV: timestamp_us,gt_x,gt_y,gt_heading,pred_x,pred_y,gtsam_x,gtsam_y,...")
      ->required();
  nclt_command->add_option("--odometry", nclt.odometry, "CSV: timestamp_us,dx,dy,dtheta,...")
      ->required();
  nclt_command->add_option("--out-dir", nclt.out_dir, "is made if it is not there")->required();
  relocd::KittiOptions kitti;
  auto* kitti_command = app.add_subcommand(
      "kitti", "a trajectory of KITTI's odometry benchmark: the camera's path in the plane");
  kitti_command->add_option("--poses", kitti.poses, "12 numbers a line: 3x4, camera to world")
      ->required();
  kitti_command->add_option("--rate-hz", kitti.rate_hz, "of the lines")->capture_default_str();
  kitti_command->add_option("--out", kitti.out, "CSV: t_s,x_m,y_m,theta_rad")->required();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  const bool is_kitti = kitti_command->parsed();
  const auto ok = is_kitti ? relocd::ImportKitti(kitti) : relocd::ImportNclt(nclt);
  if (!ok) {
    fmt::print(stderr, "reloc import {}: {}\n", is_kitti ? "kitti" : "nclt", ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
