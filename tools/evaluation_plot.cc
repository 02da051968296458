#include "evaluation_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "geometry/covariance.h"
#include "geometry/planar.h"
#include "plot_canvas.h"

namespace relocd {
namespace {

// Lengths are in pixels of the finished image.
constexpr double kWidth = 1440.0;
constexpr double kMapWidth = 1130.0;
constexpr double kMinMapHeight = 320.0;
constexpr double kMaxMapHeight = 760.0;
constexpr double kErrorHeight = 200.0;
constexpr double kLeft = 95.0;
constexpr double kTop = 75.0;
constexpr double kBetween = 85.0;
constexpr double kBottom = 65.0;

constexpr double kSmallestErrorM = 0.01;  // the scale of a plot without errors

const cv::Scalar kTruthColour(150, 140, 135);
const cv::Scalar kEllipseColour(220, 170, 90);
const cv::Scalar kErrorColour(160, 90, 30);
const cv::Scalar kBoundColour(245, 222, 190);

/// From good to bad, in blue, green, red.
cv::Scalar ErrorColour(double share) {
  static constexpr std::array<std::array<double, 3>, 4> kStops{
      {{160, 90, 30}, {120, 190, 80}, {60, 175, 250}, {40, 40, 205}}};
  const double position = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const auto low = std::min(static_cast<std::size_t>(position), kStops.size() - 2);
  const double blend = position - static_cast<double>(low);
  cv::Scalar colour;
  for (int channel = 0; channel < 3; ++channel) {
    const auto c = static_cast<std::size_t>(channel);
    colour[channel] = (1.0 - blend) * kStops.at(low).at(c) + blend * kStops.at(low + 1).at(c);
  }
  return colour;
}

/// The two axes of W that are drawn: to the right and up.
struct View {
  int right = 0;
  int up = 1;

  [[nodiscard]] Eigen::Vector2d operator()(const Pose3& pose) const {
    return {pose.translation()[right], pose.translation()[up]};
  }
};

/// Looks along the axis that the truth moves least along.
View ChooseView(const Evaluation& evaluation) {
  if (evaluation.planar) return {};
  std::array<Range, 3> extents;
  for (const PosePair& pair : evaluation.pairs) {
    for (int axis = 0; axis < 3; ++axis)
      extents.at(static_cast<std::size_t>(axis)).Include(pair.X_WB_true.translation()[axis]);
  }
  const auto least = std::ranges::min_element(
      extents, [](const Range& a, const Range& b) { return a.size() < b.size(); });
  switch (least - extents.begin()) {
    case 0:
      return {.right = 1, .up = 2};
    case 1:
      return {.right = 0, .up = 2};
    default:
      return {.right = 0, .up = 1};
  }
}

/// The part of the truth that the estimates go along.
std::vector<Eigen::Vector2d> TruthPoints(const Evaluation& evaluation, const View& view) {
  std::vector<Eigen::Vector2d> points;
  for (const EvaluatedPose& pose : evaluation.truths) {
    if (pose.time_ns < evaluation.pairs.front().time_ns) continue;
    if (pose.time_ns > evaluation.pairs.back().time_ns) break;
    points.push_back(view(pose.X_WB));
  }
  return points;
}

/// Puts equal scales on both axes around the truth and the estimates; those with errors far above
/// the others' may lie outside.
Panel MakeMapPanel(const std::vector<Eigen::Vector2d>& truth,
                   const Evaluation& evaluation,
                   const View& view,
                   double error_limit) {
  Range x;
  Range y;
  for (const Eigen::Vector2d& point : truth) {
    x.Include(point.x());
    y.Include(point.y());
  }
  const std::vector<double> errors = PositionErrors(evaluation.pairs);
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (errors[i] > 2.0 * error_limit && errors[i] > 1.0) continue;
    x.Include(evaluation.pairs[i].X_WB.translation()[view.right]);
    y.Include(evaluation.pairs[i].X_WB.translation()[view.up]);
  }
  constexpr double kLeastExtent = 0.1;  // m, for a robot that stands
  constexpr double kMargin = 0.04;
  const double margin = std::max(kLeastExtent, kMargin * std::max(x.size(), y.size()));
  x.Grow(margin);
  y.Grow(margin);
  const double height = std::clamp(kMapWidth * y.size() / x.size(), kMinMapHeight, kMaxMapHeight);
  const double metres_per_pixel = std::max(x.size() / kMapWidth, y.size() / height);
  x.Grow(0.5 * (metres_per_pixel * kMapWidth - x.size()));
  y.Grow(0.5 * (metres_per_pixel * height - y.size()));
  return {.box = {kLeft, kTop, kMapWidth, height}, .x = x, .y = y};
}

/// About sixty of them, so that they can be told apart. @return whether there are any.
bool DrawEllipses(Canvas& canvas, const Panel& panel, const Evaluation& evaluation) {
  constexpr std::size_t kMost = 60;
  const std::size_t stride = std::max<std::size_t>(1, evaluation.estimates.size() / kMost);
  std::vector<std::vector<cv::Point2d>> ellipses;
  for (std::size_t i = 0; i < evaluation.estimates.size(); i += stride) {
    const EvaluatedPose& estimate = evaluation.estimates[i];
    const Pose2 X_WB = ProjectToPlane(estimate.X_WB);
    if (!evaluation.planar || !estimate.covariance || !panel.Contains(X_WB.translation())) continue;
    const Eigen::Matrix2d covariance = estimate.covariance->topLeftCorner<2, 2>();
    const double extent = std::sqrt(covariance.trace());
    if (extent > 0.5 * std::max(panel.x.size(), panel.y.size())) continue;  // would hide the map
    ellipses.push_back(EllipsePixels(panel, X_WB, covariance));
  }
  constexpr double kOpacity = 0.18;
  canvas.Translucent(kOpacity, [&] {
    for (const auto& ellipse : ellipses)
      canvas.Polygon(ellipse, kEllipseColour);
  });
  for (const auto& ellipse : ellipses)
    canvas.Polyline(ellipse, kEllipseColour, 0.5);
  return !ellipses.empty();
}

/// @return how many estimates are outside the panel.
std::size_t DrawEstimates(Canvas& canvas,
                          const Panel& panel,
                          const Evaluation& evaluation,
                          const View& view,
                          double error_limit) {
  const std::vector<double> errors = PositionErrors(evaluation.pairs);
  constexpr std::size_t kFew = 300;
  const double radius = evaluation.pairs.size() > kFew ? 2.2 : 3.2;
  std::size_t outside = 0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const Eigen::Vector2d point = view(evaluation.pairs[i].X_WB);
    if (!panel.Contains(point)) {
      ++outside;
      continue;
    }
    const Eigen::Vector2d truth = view(evaluation.pairs[i].X_WB_true);
    const cv::Scalar colour = ErrorColour(errors[i] / error_limit);
    canvas.Line(panel.Pixel(truth), panel.Pixel(point), colour, 0.5);
    canvas.Dot(panel.Pixel(point), radius, colour);
  }
  return outside;
}

void DrawTruth(Canvas& canvas, const Panel& panel, const std::vector<Eigen::Vector2d>& truth) {
  std::vector<cv::Point2d> pixels;
  pixels.reserve(truth.size());
  for (const Eigen::Vector2d& point : truth)
    pixels.push_back(panel.Pixel(point));
  canvas.Polyline(pixels, kTruthColour, 2.5);
  if (pixels.empty()) return;
  constexpr double kRing = 7.0;
  canvas.Dot(pixels.front(), kRing, canvas.theme().ink);
  canvas.Dot(pixels.front(), kRing - 2.0, canvas.theme().background);
  canvas.Text("start", pixels.front() + cv::Point2d(kRing + 4.0, -kRing), {0.0, 1.0});
}

struct LegendFacts {
  bool has_ellipses = false;
  std::size_t outside = 0;
  bool aligned = false;
};

void DrawLegend(Canvas& canvas, const Panel& panel, const LegendFacts& facts, double error_limit) {
  const double x = panel.box.br().x + 22.0;
  constexpr double kStep = 26.0;
  constexpr double kSample = 26.0;
  double y = panel.box.y + 10.0;
  canvas.Line({x, y}, {x + kSample, y}, kTruthColour, 2.5);
  canvas.Text("truth", {x + kSample + 8.0, y}, {0.0, 0.5});
  y += kStep;
  canvas.Dot({x + 0.5 * kSample, y}, 3.2, ErrorColour(0.0));
  canvas.Text(facts.aligned ? "aligned estimate" : "estimate", {x + kSample + 8.0, y}, {0.0, 0.5});
  if (facts.has_ellipses) {
    y += kStep;
    canvas.Rectangle({x + 4.0, y - 7.0, kSample - 8.0, 14.0}, kEllipseColour);
    canvas.Text("reported 95 %", {x + kSample + 8.0, y}, {0.0, 0.5});
  }
  if (facts.outside > 0) {
    y += kStep;
    canvas.Text(fmt::format("({} outside the view)", facts.outside), {x, y}, {0.0, 0.5});
  }
  y += 1.6 * kStep;
  canvas.Text("error [m]", {x, y}, {0.0, 0.5});
  y += 0.9 * kStep;
  constexpr int kColours = 60;
  constexpr double kBarHeight = 120.0;
  for (int i = 0; i < kColours; ++i) {
    const double share = 1.0 - (i + 0.5) / kColours;
    canvas.Rectangle({x, y + kBarHeight * i / kColours, 18.0, kBarHeight / kColours},
                     ErrorColour(share));
  }
  canvas.Text(fmt::format(">= {:.3g} (p95)", error_limit), {x + 26.0, y}, {0.0, 0.5});
  canvas.Text(
      fmt::format("{:.3g}", 0.5 * error_limit), {x + 26.0, y + 0.5 * kBarHeight}, {0.0, 0.5});
  canvas.Text("0", {x + 26.0, y + kBarHeight}, {0.0, 0.5});
}

/// The radius that a reported covariance says 95 % of the errors stay below, along its long axis.
double ReportedBound(const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix2d position = covariance.topLeftCorner<2, 2>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(position, Eigen::EigenvaluesOnly);
  return std::sqrt(kChiSquared95Dof2 * axes.eigenvalues()[1]);
}

void DrawErrorOverTime(Canvas& canvas, const Evaluation& evaluation, double top) {
  const std::vector<double> errors = PositionErrors(evaluation.pairs);
  const auto seconds = [&](std::size_t i) {
    return static_cast<double>(evaluation.pairs[i].time_ns - evaluation.pairs.front().time_ns) *
           1e-9;
  };
  const ErrorSummary summary = Summarize(errors);
  // One outlier must not press all others to the ground.
  const double highest = std::max(kSmallestErrorM, std::min(1.1 * summary.max, 3.0 * summary.p95));
  const Panel panel{.box = {kLeft, top, kMapWidth, kErrorHeight},
                    .x = {0.0, std::max(1e-3, evaluation.duration_s)},
                    .y = {0.0, highest}};
  const auto pixel = [&](std::size_t i, double value) {
    return panel.Pixel({seconds(i), std::min(value, highest)});
  };
  std::vector<cv::Point2d> bound;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const auto& covariance = evaluation.estimates[i].covariance;
    if (!covariance) continue;
    if (bound.empty()) bound.push_back(pixel(i, 0.0));
    bound.push_back(pixel(i, ReportedBound(*covariance)));
  }
  if (!bound.empty()) {
    bound.emplace_back(bound.back().x, panel.box.br().y);
    canvas.Polygon(bound, kBoundColour);
  }
  DrawAxes(canvas,
           panel,
           "time [s]",
           bound.empty() ? "position error [m]" : "position error [m], shaded: reported 95 %");
  for (std::size_t i = 1; i < errors.size(); ++i) {
    constexpr double kLongestGapS = 5.0;
    if (seconds(i) - seconds(i - 1) > kLongestGapS) continue;
    canvas.Line(pixel(i - 1, errors[i - 1]), pixel(i, errors[i]), kErrorColour, 1.2);
  }
}

}  // namespace

Result<void> WritePlot(const Evaluation& evaluation,
                       const std::string& title,
                       const std::string& path) {
  const View view = ChooseView(evaluation);
  const ErrorSummary& summary =
      evaluation.alignment ? evaluation.aligned_position_m : evaluation.position_m;
  const double error_limit = std::max(kSmallestErrorM, summary.p95);
  const std::vector<Eigen::Vector2d> truth = TruthPoints(evaluation, view);
  const Panel map = MakeMapPanel(truth, evaluation, view, error_limit);
  const double error_top = map.box.br().y + kBetween;
  Canvas canvas(kWidth, error_top + kErrorHeight + kBottom);

  constexpr std::string_view kAxes = "xyz";
  const auto axis = [&](int i) {
    return fmt::format("{} [m]", kAxes[static_cast<std::size_t>(i)]);
  };
  DrawAxes(canvas, map, axis(view.right), axis(view.up));
  DrawScale(canvas, map);
  DrawTruth(canvas, map, truth);
  LegendFacts facts{.has_ellipses = DrawEllipses(canvas, map, evaluation),
                    .outside = 0,
                    .aligned = evaluation.alignment.has_value()};
  facts.outside = DrawEstimates(canvas, map, evaluation, view, error_limit);
  DrawLegend(canvas, map, facts, error_limit);
  DrawErrorOverTime(canvas, evaluation, error_top);
  const std::string numbers =
      fmt::format("{} poses, {:.0f} m: mean {:.3g} m, RMSE {:.3g} m, median {:.3g} m, max {:.3g} m",
                  summary.count,
                  evaluation.truth_length_m,
                  summary.mean,
                  summary.rmse,
                  summary.median,
                  summary.max);
  constexpr double kTitleHeight = 16.0;
  canvas.Text(title, {kLeft, 18.0}, {0.0, 0.5}, kTitleHeight);
  canvas.Text(numbers, {kLeft + kMapWidth, 50.0}, {1.0, 0.5});

  return WritePng(canvas.Finish(), path);
}

}  // namespace relocd
