#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "evaluation.h"
#include "evaluation_input.h"
#include "report_log.h"

namespace relocd {

/// Above this a camera pose would mislead who follows it.
inline constexpr double kOutlierM = 1.0;

/// What one row of a table says beside its pose.
struct RowFacts {
  std::int64_t time_ns = 0;
  bool has_pose = false;
  std::string status;                ///< Empty without such a column.
  std::optional<double> confidence;  ///< In [0, 1].
};

/// One of the trajectories that a report is about.
struct ReportTable {
  EvaluatedTrajectory trajectory;
  std::vector<RowFacts> rows;
};

/// Reads a table with `time_ns,x_m,y_m,heading_rad`, and if there `cov_xx,...,cov_tt`, `status`,
/// `confidence`.
///
/// @return kInvalidInput, also when the file is not there or has no rows: a report without it would
/// not be one.
Result<ReportTable> ReadReportTable(const std::string& path);
Result<ReportTable> ParseReportTable(std::string_view text, const std::string& path);

/// How one source of poses did over the drive.
struct ReportRow {
  std::string key;                         ///< For scripts.
  std::string name;                        ///< For people.
  std::optional<Evaluation> evaluation{};  ///< Nothing when it gave no pose at all.
  ErrorSummary position_m{};
  ErrorSummary heading_deg{};
  std::size_t outliers = 0;  ///< Off by more than kOutlierM.
};

/// A time during which LOCALIZATION's status was the same.
struct StatusSpan {
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;
  std::string status;  ///< `silent` where no message came for more than a second.
};

/// All numbers of a drive.
struct DriveReport {
  std::string title;
  std::string truth_path;
  std::vector<EvaluatedPose> truths;  ///< While there was odometry.
  double duration_s = 0.0;            ///< Of these.
  double length_m = 0.0;

  ReportRow odometry;          ///< Started at the true first pose.
  ReportRow odometry_aligned;  ///< Laid over the truth as well as it goes.
  ReportRow camera;
  ReportRow fused;

  std::vector<RowFacts> camera_rows;                       ///< One for each image worked on.
  std::map<std::string, std::size_t> images_without_pose;  ///< By reason.
  std::vector<StatusSpan> status_spans;
  std::map<std::string, double> status_shares;  ///< Of the time; empty without statuses.
  std::optional<LogFacts> log;

  [[nodiscard]] std::array<const ReportRow*, 4> rows() const {
    return {&odometry, &odometry_aligned, &camera, &fused};
  }
};

/// The tables that a report is made from: X_WB of the truth, X_OB of the odometry, X_WB by the
/// camera alone, X_WB as published.
struct ReportTables {
  EvaluatedTrajectory truth;
  ReportTable odometry;
  ReportTable camera;
  ReportTable fused;
};

/// @return kInvalidInput when a table has no pose during the truth's time; the camera's may have
/// none at all.
Result<DriveReport> MakeDriveReport(const ReportTables& tables);

/// The tables that people read.
std::string FormatReportText(const DriveReport& report);
/// The same for scripts, in one line.
std::string FormatReportJson(const DriveReport& report);

/// One line that says how it went.
std::string DescribeOutcome(const DriveReport& report);
/// Images taken, worked on, with and without a pose.
std::string DescribeImages(const DriveReport& report);

}  // namespace relocd
