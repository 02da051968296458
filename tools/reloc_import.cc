#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "core/csv.h"
#include "core/exit_code.h"
#include "core/file.h"
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
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (auto ok = relocd::ImportNclt(nclt); !ok) {
    fmt::print(stderr, "reloc import nclt: {}\n", ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
