#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "geometry/planar.h"
#include "report_plot.h"

namespace relocd {
namespace {

// In units of the canvas, as in the drive's figure.
constexpr double kPixelsPerUnit = 1.5;
constexpr double kWidth = 960.0;
constexpr double kLeft = 66.0;
constexpr double kPanelWidth = 872.0;
constexpr double kStatusTop = 46.0;
constexpr double kStatusHeight = 12.0;
constexpr double kPositionTop = 128.0;
constexpr double kPositionHeight = 220.0;
constexpr double kHeadingTop = 438.0;
constexpr double kHeadingHeight = 190.0;
constexpr double kHeight = 688.0;

constexpr double kSigmas = 3.0;
constexpr double kDegPerRad = 180.0 / std::numbers::pi;

/// One error, and the standard deviation that was reported for it.
struct ErrorSample {
  double time_s = 0.0;
  double error = 0.0;
  double sigma = 0.0;  ///< 0 when none was reported.
};
using ErrorSeries = std::vector<ErrorSample>;

double Seconds(std::int64_t time_ns) {
  return static_cast<double>(time_ns) * 1e-9;
}

/// Of the position's long axis.
double PositionSigma(const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix2d position = covariance.topLeftCorner<2, 2>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(position, Eigen::EigenvaluesOnly);
  return std::sqrt(axes.eigenvalues()[1]);
}

ErrorSeries PositionSeries(const ReportRow& row) {
  ErrorSeries series;
  if (!row.evaluation) return series;
  const std::vector<double> errors = PositionErrors(row.evaluation->pairs);
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const auto& covariance = row.evaluation->estimates[i].covariance;
    series.push_back({.time_s = Seconds(row.evaluation->pairs[i].time_ns),
                      .error = errors[i],
                      .sigma = covariance ? PositionSigma(*covariance) : 0.0});
  }
  return series;
}

/// Signed: positive where the estimate is turned too far to the left.
ErrorSeries HeadingSeries(const ReportRow& row) {
  ErrorSeries series;
  if (!row.evaluation || !row.evaluation->has_heading) return series;
  for (std::size_t i = 0; i < row.evaluation->pairs.size(); ++i) {
    const PosePair& pair = row.evaluation->pairs[i];
    const auto& covariance = row.evaluation->estimates[i].covariance;
    const double error_rad =
        (ProjectToPlane(pair.X_WB_true).Inverse() * ProjectToPlane(pair.X_WB)).yaw();
    series.push_back({.time_s = Seconds(pair.time_ns),
                      .error = kDegPerRad * error_rad,
                      .sigma = covariance ? kDegPerRad * std::sqrt((*covariance)(2, 2)) : 0.0});
  }
  return series;
}

/// What one panel shows.
struct ErrorPair {
  ErrorSeries fused;
  ErrorSeries camera;
  double outlier = std::numeric_limits<double>::infinity();  ///< The camera's in another colour.
};

/// The largest error that the panel must show: all of the fused ones, but no outlier that would
/// press the others to the ground.
double HighestShown(const ErrorPair& pair, double least) {
  constexpr double kRoom = 1.15;
  constexpr double kMostOverP95 = 3.0;
  double highest = least;
  for (const ErrorSeries* series : {&pair.fused, &pair.camera}) {
    std::vector<double> errors;
    for (const ErrorSample& sample : *series)
      errors.push_back(std::abs(sample.error));
    const ErrorSummary summary = Summarize(std::move(errors));
    highest = std::max(highest, std::min(kRoom * summary.max, kMostOverP95 * summary.p95));
  }
  return highest;
}

/// All of the drive, also where there was no pose.
Range TimeAxis(const DriveReport& report) {
  constexpr double kShortestS = 1e-3;
  const double begin_s = Seconds(report.odometry.evaluation->pairs.front().time_ns);
  const double end_s = Seconds(report.odometry.evaluation->pairs.back().time_ns);
  return {.low = begin_s, .high = std::max(begin_s + kShortestS, end_s)};
}

void DrawBand(Canvas& canvas,
              const Panel& panel,
              const ErrorSeries& series,
              const cv::Scalar& colour) {
  constexpr std::size_t kMost = 1500;
  const std::size_t stride = std::max<std::size_t>(1, series.size() / kMost);
  std::vector<cv::Point2d> outline;
  std::vector<cv::Point2d> lower;
  for (std::size_t i = 0; i < series.size(); i += stride) {
    if (series[i].sigma <= 0.0) continue;
    const double bound = kSigmas * series[i].sigma;
    outline.push_back(panel.Pixel({series[i].time_s, std::min(bound, panel.y.high)}));
    lower.push_back(panel.Pixel({series[i].time_s, std::max(-bound, panel.y.low)}));
  }
  if (outline.size() < 2) return;
  outline.insert(outline.end(), lower.rbegin(), lower.rend());
  constexpr double kOpacity = 0.2;
  canvas.Translucent(kOpacity, [&] { canvas.Polygon(outline, colour); });
}

/// Dots, in another colour above `outlier`; what is beyond the panel is a triangle at its edge.
/// Dashes: what was reported.
void DrawCameraErrors(Canvas& canvas,
                      const Panel& panel,
                      const ErrorSeries& series,
                      const ReportColours& colours,
                      double outlier) {
  constexpr double kRadius = 2.0;
  constexpr double kHalfDash = 1.8;
  for (const ErrorSample& sample : series) {
    for (const double side : {-1.0, 1.0}) {
      const Eigen::Vector2d bound(sample.time_s, side * kSigmas * sample.sigma);
      if (sample.sigma <= 0.0 || !panel.Contains(bound)) continue;
      const cv::Point2d at = panel.Pixel(bound);
      canvas.Line({at.x - kHalfDash, at.y}, {at.x + kHalfDash, at.y}, colours.camera, 0.6);
    }
  }
  for (const ErrorSample& sample : series) {
    const double shown = std::clamp(sample.error, panel.y.low, panel.y.high);
    const cv::Point2d at = panel.Pixel({sample.time_s, shown});
    if (shown == sample.error) {
      const bool is_outlier = std::abs(sample.error) > outlier;
      canvas.Dot(at, kRadius, is_outlier ? colours.outlier : colours.camera);
      continue;
    }
    const double inwards = sample.error > 0.0 ? 1.0 : -1.0;
    canvas.Polygon(
        {{at.x, at.y}, {at.x - 4.5, at.y + 8.0 * inwards}, {at.x + 4.5, at.y + 8.0 * inwards}},
        colours.outlier);
  }
}

void DrawSeries(Canvas& canvas,
                const Panel& panel,
                const ErrorSeries& series,
                const cv::Scalar& colour) {
  constexpr double kLongestGapS = 1.0;
  for (std::size_t i = 1; i < series.size(); ++i) {
    if (series[i].time_s - series[i - 1].time_s > kLongestGapS) continue;
    canvas.Line(panel.Pixel({series[i - 1].time_s, series[i - 1].error}),
                panel.Pixel({series[i].time_s, series[i].error}),
                colour,
                1.3);
  }
}

void DrawPanel(Canvas& canvas,
               const Panel& panel,
               const ErrorPair& errors,
               const ReportColours& colours) {
  canvas.Within(panel.box, [&] {
    DrawBand(canvas, panel, errors.fused, colours.fused);
    DrawCameraErrors(canvas, panel, errors.camera, colours, errors.outlier);
    DrawSeries(canvas, panel, errors.fused, colours.fused);
  });
}

cv::Scalar StatusColour(const std::string& status, const ReportColours& colours) {
  if (status == "ok") return colours.fused;
  if (status == "converging") return colours.camera;
  if (status == "dead_reckoning") return colours.odometry;
  if (status == "uninitialised" || status == "silent") return colours.truth;
  return colours.outlier;
}

/// What LOCALIZATION said of itself, and below it each image that gave no pose.
void DrawStatuses(Canvas& canvas,
                  const DriveReport& report,
                  const Panel& time_axis,
                  const ReportColours& colours) {
  const auto at = [&](std::int64_t time_ns) {
    return std::clamp(time_axis.Pixel({Seconds(time_ns), time_axis.y.low}).x,
                      time_axis.box.x,
                      time_axis.box.br().x);
  };
  double x = kLeft;
  const auto entry = [&](const std::string& text, const cv::Scalar& colour) {
    constexpr double kSample = 11.0;
    canvas.Rectangle({x, kStatusTop - 24.0, kSample, kSample}, colour);
    canvas.Text(text, {x + kSample + 5.0, kStatusTop - 18.0}, {0.0, 0.5});
    x += kSample + 5.0 + canvas.TextWidth(text) + 20.0;
  };
  for (const auto& [status, share] : report.status_shares)
    entry(fmt::format("{} {:.1f} %", status, 100.0 * share), StatusColour(status, colours));
  for (const StatusSpan& span : report.status_spans) {
    const double begin = at(span.begin_ns);
    canvas.Rectangle({begin, kStatusTop, at(span.end_ns) - begin, kStatusHeight},
                     StatusColour(span.status, colours));
  }
  if (report.images_without_pose.empty()) return;
  entry("| no camera pose", colours.outlier);
  for (const RowFacts& row : report.camera_rows) {
    const double time_s = Seconds(row.time_ns);
    if (row.has_pose || !time_axis.x.Contains(time_s)) continue;
    const double u = at(row.time_ns);
    canvas.Line({u, kStatusTop + kStatusHeight + 4.0},
                {u, kStatusTop + kStatusHeight + 14.0},
                colours.outlier,
                1.0);
  }
}

}  // namespace

cv::Mat DrawErrors(const DriveReport& report, const FigureStyle& style) {
  Canvas canvas(kWidth, kHeight, style.theme, kPixelsPerUnit);
  const ErrorPair positions{.fused = PositionSeries(report.fused),
                            .camera = PositionSeries(report.camera),
                            .outlier = kOutlierM};
  const ErrorPair headings{.fused = HeadingSeries(report.fused),
                           .camera = HeadingSeries(report.camera)};
  constexpr double kLeastPositionM = 0.05;
  constexpr double kLeastHeadingDeg = 0.2;
  const Range time = TimeAxis(report);
  const Panel position{.box = {kLeft, kPositionTop, kPanelWidth, kPositionHeight},
                       .x = time,
                       .y = {.low = 0.0, .high = HighestShown(positions, kLeastPositionM)}};
  const double highest = HighestShown(headings, kLeastHeadingDeg);
  const Panel heading{.box = {kLeft, kHeadingTop, kPanelWidth, kHeadingHeight},
                      .x = time,
                      .y = {.low = -highest, .high = highest}};

  DrawStatuses(canvas, report, position, style.colours);
  DrawAxes(canvas,
           position,
           "time [s]",
           "position error [m]: line fused, shaded its 3 sigma; dots camera, dashes its 3 sigma");
  DrawPanel(canvas, position, positions, style.colours);
  DrawAxes(canvas, heading, "time [s]", "heading error [deg], + is to the left");
  DrawPanel(canvas, heading, headings, style.colours);
  return canvas.Finish();
}

}  // namespace relocd
