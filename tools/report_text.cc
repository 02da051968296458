#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string>

#include <fmt/format.h>

#include "report_numbers.h"

namespace relocd {
namespace {

constexpr double kPercent = 100.0;

void AppendHeader(std::string& text) {
  fmt::format_to(
      std::back_inserter(text),
      "{:<36}{:>7}{:>28}{:>42}\n{:<36}{:>7}{:>8}{:>8}{:>8}{:>8}{:>8}  {:>8}{:>8}{:>8}{:>8}\n",
      "",
      "",
      "position error [m]",
      "heading error [deg]    off by",
      "",
      "poses",
      "mean",
      "RMSE",
      "median",
      "p95",
      "max",
      "mean",
      "RMSE",
      "max",
      "> 1 m");
}

void AppendRow(const ReportRow& row, std::string& text) {
  if (!row.evaluation) {
    fmt::format_to(std::back_inserter(text), "{:<36}{:>7}  no pose to compare\n", row.name, 0);
    return;
  }
  const ErrorSummary& position = row.position_m;
  fmt::format_to(std::back_inserter(text),
                 "{:<36}{:>7}{:>8.3f}{:>8.3f}{:>8.3f}{:>8.3f}{:>8.3f}",
                 row.name,
                 position.count,
                 position.mean,
                 position.rmse,
                 position.median,
                 position.p95,
                 position.max);
  if (row.heading_deg.count > 0) {
    fmt::format_to(std::back_inserter(text),
                   "  {:>8.3f}{:>8.3f}{:>8.3f}",
                   row.heading_deg.mean,
                   row.heading_deg.rmse,
                   row.heading_deg.max);
  } else {
    fmt::format_to(std::back_inserter(text), "  {:>8}{:>8}{:>8}", "-", "-", "-");
  }
  fmt::format_to(std::back_inserter(text), "{:>8}\n", row.outliers);
}

void AppendCoverage(const ReportRow& row, std::string& text) {
  if (!row.evaluation || row.evaluation->coverage.position_count == 0) {
    fmt::format_to(std::back_inserter(text), "{:<36}  no covariance is reported\n", row.name);
    return;
  }
  const Coverage& coverage = row.evaluation->coverage;
  fmt::format_to(std::back_inserter(text),
                 "{:<36}{:>12.1f} %{:>16}{:>18.3f} m\n",
                 row.name,
                 kPercent * coverage.position_share,
                 coverage.pose_count > 0 ? fmt::format("{:.1f} %", kPercent * coverage.pose_share)
                                         : std::string("-"),
                 row.evaluation->median_sigma_m);
}

std::string DescribeStatuses(const DriveReport& report) {
  std::string text;
  for (const auto& [status, share] : report.status_shares) {
    fmt::format_to(std::back_inserter(text),
                   "{}{} {:.1f} %",
                   text.empty() ? "" : ", ",
                   status,
                   kPercent * share);
  }
  return text.empty() ? "not in the table" : text;
}

std::string JsonRow(const ReportRow& row) {
  std::string text = fmt::format(R"({{"poses":{},"position_m":{},"over_1m":{})",
                                 row.position_m.count,
                                 JsonSummary(row.position_m),
                                 row.outliers);
  if (row.heading_deg.count > 0) text += ",\"heading_deg\":" + JsonSummary(row.heading_deg);
  if (row.evaluation && row.evaluation->coverage.position_count > 0) {
    text += ",\"coverage\":" + JsonCoverage(*row.evaluation);
  }
  return text + "}";
}

std::string JsonShares(const DriveReport& report) {
  std::string text;
  for (const auto& [status, share] : report.status_shares)
    text += fmt::format("{}{}:{}", text.empty() ? "" : ",", JsonString(status), share);
  return "{" + text + "}";
}

std::string JsonLog(const LogFacts& log) {
  std::string latencies;
  for (const ReportedLatency& latency : log.latencies) {
    latencies += fmt::format(R"({}{}:{{"p50":{},"p99":{}}})",
                             latencies.empty() ? "" : ",",
                             JsonString(latency.key),
                             latency.p50_ms,
                             latency.p99_ms);
  }
  return fmt::format(R"(,"latency_ms":{{{}}},"messages":{},"messages_lost":{},"images_taken":{})",
                     latencies,
                     log.messages,
                     log.lost,
                     log.image_times_ns.size());
}

}  // namespace

std::string DescribeOutcome(const DriveReport& report) {
  const ErrorSummary& fused = report.fused.position_m;
  return fmt::format(
      "{:.0f} m in {:.0f} s; fused: mean error {:.2f} m, max {:.2f} m; odometry alone: mean {:.2f} "
      "m, "
      "max {:.2f} m",
      report.length_m,
      report.duration_s,
      fused.mean,
      fused.max,
      report.odometry.position_m.mean,
      report.odometry.position_m.max);
}

std::string DescribeImages(const DriveReport& report) {
  std::size_t without = 0;
  std::string reasons;
  for (const auto& [reason, count] : report.images_without_pose) {
    without += count;
    reasons += fmt::format("{}{} {}", reasons.empty() ? "" : ", ", count, reason);
  }
  const std::size_t worked_on = report.camera_rows.size();
  std::string text =
      report.log && !report.log->image_times_ns.empty()
          ? fmt::format("{} taken, {} worked on", report.log->image_times_ns.size(), worked_on)
          : fmt::format("{} worked on", worked_on);
  text += fmt::format(": {} gave a pose, {} none", worked_on - without, without);
  if (!reasons.empty()) text += fmt::format(" ({})", reasons);
  return text +
         fmt::format("; {} poses are off by more than {:g} m", report.camera.outliers, kOutlierM);
}

std::string FormatReportText(const DriveReport& report) {
  std::string text = fmt::format(
      "{}\n{}\ntruth: {}\n\n", report.title, DescribeOutcome(report), report.truth_path);
  AppendHeader(text);
  for (const ReportRow* row : report.rows())
    AppendRow(*row, text);
  fmt::format_to(std::back_inserter(text),
                 "\n{:<36}{:>14}{:>16}{:>20}\n",
                 "truth inside the reported 95 %",
                 "(x, y)",
                 "with heading",
                 "median sigma");
  AppendCoverage(report.camera, text);
  AppendCoverage(report.fused, text);
  fmt::format_to(std::back_inserter(text),
                 "\nimages   {}\nstatus   {} of the time\n",
                 DescribeImages(report),
                 DescribeStatuses(report));
  if (!report.log) return text;
  for (const ReportedLatency& latency : report.log->latencies) {
    fmt::format_to(std::back_inserter(text),
                   "latency  {:<38} p50 {:8.2f} ms   p99 {:8.2f} ms\n",
                   latency.name,
                   latency.p50_ms,
                   latency.p99_ms);
  }
  fmt::format_to(std::back_inserter(text),
                 "log      {} messages, {} lost\n",
                 report.log->messages,
                 report.log->lost);
  return text;
}

std::string FormatReportJson(const DriveReport& report) {
  std::string text = fmt::format(R"({{"title":{},"truth":{},"duration_s":{},"length_m":{})",
                                 JsonString(report.title),
                                 JsonString(report.truth_path),
                                 report.duration_s,
                                 report.length_m);
  for (const ReportRow* row : report.rows())
    text += fmt::format(",{}:{}", JsonString(row->key), JsonRow(*row));
  text += fmt::format(
      R"(,"images":{{"worked_on":{},"poses":{},"without_pose":{}}},"status_share":{})",
      report.camera_rows.size(),
      std::ranges::count_if(report.camera_rows, [](const RowFacts& row) { return row.has_pose; }),
      JsonCounts(report.images_without_pose),
      JsonShares(report));
  if (report.log) text += JsonLog(*report.log);
  return text + "}\n";
}

}  // namespace relocd
