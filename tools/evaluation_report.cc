#include <cstddef>
#include <iterator>
#include <map>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "evaluation.h"
#include "geometry/planar.h"

namespace relocd {
namespace {

constexpr double kPercent = 100.0;

void AppendRow(const std::string& name, const ErrorSummary& summary, std::string& text) {
  if (summary.count == 0) {
    fmt::format_to(std::back_inserter(text), "{:<28}{:>8}\n", name, 0);
    return;
  }
  fmt::format_to(std::back_inserter(text),
                 "{:<28}{:>8}{:>10.3f}{:>10.3f}{:>10.3f}{:>10.3f}{:>10.3f}\n",
                 name,
                 summary.count,
                 summary.mean,
                 summary.rmse,
                 summary.median,
                 summary.p95,
                 summary.max);
}

void AppendCoverage(const Evaluation& evaluation, std::string& text) {
  const Coverage& coverage = evaluation.coverage;
  if (coverage.position_count == 0) {
    text += "\nno covariance is reported\n";
    return;
  }
  fmt::format_to(
      std::back_inserter(text),
      "\nreported covariance ({} rows, median sigma {:.3f} m)\n"
      "  truth inside the 95 % ellipse (x, y)        {:5.1f} %, mean squared Mahalanobis distance "
      "{:.2f} (2 is honest)\n",
      coverage.position_count,
      evaluation.median_sigma_m,
      kPercent * coverage.position_share,
      coverage.position_nees);
  if (coverage.pose_count == 0) return;
  fmt::format_to(
      std::back_inserter(text),
      "  truth inside the 95 % ellipsoid (x, y, yaw) {:5.1f} %, mean squared Mahalanobis distance "
      "{:.2f} (3 is honest)\n",
      kPercent * coverage.pose_share,
      coverage.pose_nees);
}

std::string DescribeMissing(const EvaluatedTrajectory& trajectory) {
  std::string text;
  for (const auto& [status, count] : trajectory.rows_without_pose) {
    fmt::format_to(std::back_inserter(text), "{}{} {}", text.empty() ? "" : ", ", count, status);
  }
  return text.empty() ? text : " (without a pose: " + text + ")";
}

std::string JsonRelative(const std::vector<RelativeSummary>& relative) {
  std::string text;
  for (const RelativeSummary& summary : relative) {
    fmt::format_to(
        std::back_inserter(text),
        R"({}{{"over":{},"translation_unit":{},"rotation_unit":{},"translation":{},"rotation":{}}})",
        text.empty() ? "" : ",",
        JsonString(summary.over),
        JsonString(summary.translation_unit),
        JsonString(summary.rotation_unit),
        JsonSummary(summary.translation),
        JsonSummary(summary.rotation));
  }
  return "[" + text + "]";
}

}  // namespace

std::string JsonString(std::string_view text) {
  std::string json = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') json += '\\';
    constexpr char kFirstPrintable = 0x20;
    json += c >= 0 && c < kFirstPrintable ? ' ' : c;
  }
  return json + '"';
}

std::string JsonSummary(const ErrorSummary& summary) {
  return fmt::format(R"({{"count":{},"mean":{},"rmse":{},"median":{},"p95":{},"max":{}}})",
                     summary.count,
                     summary.mean,
                     summary.rmse,
                     summary.median,
                     summary.p95,
                     summary.max);
}

std::string JsonCoverage(const Evaluation& evaluation) {
  const Coverage& coverage = evaluation.coverage;
  return fmt::format(
      R"({{"position_count":{},"position_in95":{},"position_nees":{},"pose_count":{},"pose_in95":{},)"
      R"("pose_nees":{},"median_sigma_m":{}}})",
      coverage.position_count,
      coverage.position_share,
      coverage.position_nees,
      coverage.pose_count,
      coverage.pose_share,
      coverage.pose_nees,
      evaluation.median_sigma_m);
}

std::string JsonCounts(const std::map<std::string, std::size_t>& counts) {
  std::string text;
  for (const auto& [name, count] : counts) {
    fmt::format_to(
        std::back_inserter(text), "{}{}:{}", text.empty() ? "" : ",", JsonString(name), count);
  }
  return "{" + text + "}";
}

std::string FormatTable(const Evaluation& evaluation,
                        const EvaluatedTrajectory& truth,
                        const EvaluatedTrajectory& estimate) {
  const char* angle = evaluation.planar ? "heading" : "rotation";
  std::string text = fmt::format(
      "truth     {}: {} rows{}\nestimate  {}: {} rows{}\nmatched   {} of {} poses over {:.1f} s "
      "and "
      "{:.1f} m, {}; {} outside the truth's time, {} in its gaps\n\n",
      truth.path,
      truth.rows,
      DescribeMissing(truth),
      estimate.path,
      estimate.rows,
      DescribeMissing(estimate),
      evaluation.pairs.size(),
      estimate.poses.size(),
      evaluation.duration_s,
      evaluation.truth_length_m,
      evaluation.planar ? "in the plane" : "in space",
      evaluation.outside,
      evaluation.in_gaps);
  fmt::format_to(std::back_inserter(text),
                 "{:<28}{:>8}{:>10}{:>10}{:>10}{:>10}{:>10}\n",
                 "",
                 "count",
                 "mean",
                 "rmse",
                 "median",
                 "p95",
                 "max");
  AppendRow("position [m]", evaluation.position_m, text);
  if (evaluation.has_heading) {
    AppendRow(fmt::format("{} [deg]", angle), evaluation.rotation_deg, text);
  }
  if (evaluation.alignment) {
    AppendRow("aligned position [m]", evaluation.aligned_position_m, text);
    if (evaluation.has_heading) {
      AppendRow(fmt::format("aligned {} [deg]", angle), evaluation.aligned_rotation_deg, text);
    }
  }
  for (const RelativeSummary& relative : evaluation.relative) {
    AppendRow(fmt::format("over {} position [{}]", relative.over, relative.translation_unit),
              relative.translation,
              text);
    AppendRow(fmt::format("over {} {} [{}]", relative.over, angle, relative.rotation_unit),
              relative.rotation,
              text);
  }
  if (evaluation.alignment && evaluation.planar) {
    const Pose2 alignment = ProjectToPlane(*evaluation.alignment);
    fmt::format_to(std::back_inserter(text),
                   "\nalignment: x {:.3f} m, y {:.3f} m, yaw {:.5f} rad, put before the estimate\n",
                   alignment.x(),
                   alignment.y(),
                   alignment.yaw());
  }
  AppendCoverage(evaluation, text);
  return text;
}

std::string FormatJson(const Evaluation& evaluation,
                       const EvaluatedTrajectory& truth,
                       const EvaluatedTrajectory& estimate) {
  std::string text = fmt::format(
      R"({{"truth":{},"estimate":{},"planar":{},"estimate_rows":{},"without_pose":{},"matched":{},)"
      R"("outside":{},"in_gaps":{},"duration_s":{},"truth_length_m":{},"position_m":{})",
      JsonString(truth.path),
      JsonString(estimate.path),
      evaluation.planar,
      estimate.rows,
      JsonCounts(estimate.rows_without_pose),
      evaluation.pairs.size(),
      evaluation.outside,
      evaluation.in_gaps,
      evaluation.duration_s,
      evaluation.truth_length_m,
      JsonSummary(evaluation.position_m));
  if (evaluation.has_heading) {
    text += ",\"rotation_deg\":" + JsonSummary(evaluation.rotation_deg);
    text += ",\"relative\":" + JsonRelative(evaluation.relative);
  }
  if (evaluation.alignment) {
    text += ",\"aligned_position_m\":" + JsonSummary(evaluation.aligned_position_m);
    if (evaluation.has_heading) {
      text += ",\"aligned_rotation_deg\":" + JsonSummary(evaluation.aligned_rotation_deg);
    }
  }
  if (evaluation.coverage.position_count > 0) text += ",\"coverage\":" + JsonCoverage(evaluation);
  return text + "}\n";
}

}  // namespace relocd
