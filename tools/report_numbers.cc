#include "report_numbers.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "core/csv.h"
#include "core/file.h"
#include "geometry/trajectory_metrics.h"

namespace relocd {
namespace {

constexpr double kSecondsPerNanosecond = 1e-9;
/// A hundred periods of LOCALIZATION: whoever drives by it would have stopped.
constexpr std::int64_t kSilentAfterNs = 1'000'000'000;

Result<std::vector<RowFacts>> ReadRowFacts(const CsvTable& table) {
  const auto times = table.Columns({"time_ns", "x_m"});
  if (!times) return times.error();
  const auto status = table.FindColumn("status");
  const auto confidence = table.FindColumn("confidence");
  std::vector<RowFacts> rows;
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    const auto time = table.Int64(row, times->front());
    if (!time) return time.error();
    RowFacts facts{.time_ns = *time,
                   .has_pose = !table.Text(row, times->back()).empty(),
                   .status = status ? table.Text(row, *status) : "",
                   .confidence = std::nullopt};
    if (confidence) {
      const auto value = table.OptionalDouble(row, *confidence);
      if (!value) return value.error();
      facts.confidence = *value;
    }
    rows.push_back(std::move(facts));
  }
  return rows;
}

ReportRow MakeRow(std::string key, std::string name, Evaluation evaluation) {
  ReportRow row{.key = std::move(key),
                .name = std::move(name),
                .position_m = evaluation.position_m,
                .heading_deg = evaluation.rotation_deg};
  if (evaluation.alignment) {
    row.position_m = evaluation.aligned_position_m;
    row.heading_deg = evaluation.aligned_rotation_deg;
  }
  row.outliers = static_cast<std::size_t>(std::ranges::count_if(
      PositionErrors(evaluation.pairs), [](double error_m) { return error_m > kOutlierM; }));
  row.evaluation = std::move(evaluation);
  return row;
}

/// The odometry in W, such that its first pose with a truth is the true one.
Result<EvaluatedTrajectory> StartAtTruth(const EvaluatedTrajectory& truth,
                                         EvaluatedTrajectory odometry) {
  const auto raw = Evaluate(truth, odometry, {});
  if (!raw) return raw.error();
  const PosePair& first = raw->pairs.front();
  const Pose3 X_WO = first.X_WB_true * first.X_WB.Inverse();
  for (EvaluatedPose& pose : odometry.poses)
    pose.X_WB = X_WO * pose.X_WB;
  return odometry;
}

Result<void> AddOdometry(const ReportTables& tables, DriveReport& report) {
  const auto started = StartAtTruth(tables.truth, tables.odometry.trajectory);
  if (!started) return started.error();
  auto alone = Evaluate(tables.truth, *started, {});
  if (!alone) return std::move(alone).error();
  report.odometry =
      MakeRow("odometry", "odometry alone, from the true start", std::move(alone).value());
  report.odometry_aligned = {.key = "odometry_aligned", .name = "odometry alone, aligned"};
  // A robot that stands has no alignment.
  auto aligned = Evaluate(tables.truth, *started, {.align = true});
  if (aligned) {
    report.odometry_aligned = MakeRow(
        report.odometry_aligned.key, report.odometry_aligned.name, std::move(aligned).value());
  }
  return {};
}

Result<void> AddCamera(const ReportTables& tables, DriveReport& report) {
  report.camera = {.key = "camera", .name = "camera alone"};
  report.camera_rows = tables.camera.rows;
  report.images_without_pose = tables.camera.trajectory.rows_without_pose;
  if (tables.camera.trajectory.poses.empty()) return {};
  auto evaluation = Evaluate(tables.truth, tables.camera.trajectory, {});
  if (!evaluation) return std::move(evaluation).error();
  report.camera = MakeRow(report.camera.key, report.camera.name, std::move(evaluation).value());
  return {};
}

/// The drive is as long as there is odometry, also where there was no fused pose yet.
void AddTruth(DriveReport& report) {
  const std::vector<PosePair>& driven = report.odometry.evaluation->pairs;
  for (const EvaluatedPose& pose : report.odometry.evaluation->truths) {
    if (pose.time_ns >= driven.front().time_ns && pose.time_ns <= driven.back().time_ns) {
      report.truths.push_back(pose);
    }
  }
  if (report.truths.empty()) {
    report.truths.push_back({.time_ns = driven.front().time_ns,
                             .X_WB = driven.front().X_WB_true,
                             .covariance = std::nullopt});
  }
  report.duration_s = report.odometry.evaluation->duration_s;
  report.length_m = report.odometry.evaluation->truth_length_m;
}

void AddSpan(const StatusSpan& span, std::vector<StatusSpan>& spans) {
  if (span.end_ns <= span.begin_ns) return;
  if (!spans.empty() && spans.back().status == span.status) {
    spans.back().end_ns = span.end_ns;
  } else {
    spans.push_back(span);
  }
}

/// A status holds until the next message. What came before the truth begins or after it ends is not
/// of the drive.
void AddStatuses(const ReportTables& tables, DriveReport& report) {
  std::vector<RowFacts> rows;
  for (const RowFacts& row : tables.fused.rows) {
    const bool is_during = row.time_ns >= tables.truth.poses.front().time_ns &&
                           row.time_ns <= tables.truth.poses.back().time_ns;
    if (is_during && !row.status.empty()) rows.push_back(row);
  }
  if (rows.empty()) return;
  for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
    const bool is_silent = rows[i + 1].time_ns - rows[i].time_ns > kSilentAfterNs;
    AddSpan({.begin_ns = rows[i].time_ns,
             .end_ns = rows[i + 1].time_ns,
             .status = is_silent ? "silent" : rows[i].status},
            report.status_spans);
  }
  if (report.status_spans.empty()) {
    report.status_shares[rows.front().status] = 1.0;
    return;
  }
  const auto whole = static_cast<double>(rows.back().time_ns - rows.front().time_ns);
  for (const StatusSpan& span : report.status_spans)
    report.status_shares[span.status] += static_cast<double>(span.end_ns - span.begin_ns) / whole;
}

}  // namespace

Result<ReportTable> ParseReportTable(std::string_view text, const std::string& path) {
  const auto table = CsvTable::Parse(text, path);
  if (!table) return table.error();
  auto rows = ReadRowFacts(*table);
  if (!rows) return std::move(rows).error();
  auto trajectory = ParseEvaluatedTrajectory(text, path);
  if (!trajectory) return std::move(trajectory).error();
  return ReportTable{.trajectory = std::move(trajectory).value(), .rows = std::move(rows).value()};
}

Result<ReportTable> ReadReportTable(const std::string& path) {
  auto text = ReadFile(path);
  if (!text) {
    return Error{ErrorKind::kInvalidInput, text.error().message};
  }
  return ParseReportTable(*text, path);
}

Result<DriveReport> MakeDriveReport(const ReportTables& tables) {
  DriveReport report;
  report.truth_path = tables.truth.path;
  auto fused = Evaluate(tables.truth, tables.fused.trajectory, {});
  if (!fused) return std::move(fused).error();
  report.fused = MakeRow("fused", "fused, as published live", std::move(fused).value());
  AddStatuses(tables, report);
  if (auto ok = AddOdometry(tables, report); !ok) return std::move(ok).error();
  AddTruth(report);
  if (auto ok = AddCamera(tables, report); !ok) return std::move(ok).error();
  return report;
}

}  // namespace relocd
