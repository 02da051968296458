#include <algorithm>

#include <opencv2/imgcodecs.hpp>

#include "map_report.h"
#include "plot_canvas.h"

namespace relocd {
namespace {

/// Blue, green, red.
cv::Scalar ColourOf(const HeldOutFrame& frame) {
  constexpr double kGoodM = 0.25;
  constexpr double kFairM = 1.0;
  if (!frame.error_m) return {96, 24, 190};
  if (*frame.error_m < kGoodM) return {110, 150, 0};
  if (*frame.error_m < kFairM) return {30, 160, 230};
  return {0, 94, 213};
}

/// Around the route, as wide as `box` and at most as high: lower for a route that goes along x.
Panel MakePanel(const TrainingReport& report, cv::Rect2d box) {
  Panel panel{.box = box, .x = {}, .y = {}};
  for (const Eigen::Vector2d& p : report.path) {
    panel.x.Include(p.x());
    panel.y.Include(p.y());
  }
  panel.x.Grow(2.0);
  panel.y.Grow(2.0);
  constexpr double kLeastHeight = 200.0;
  panel.box.height =
      std::clamp(box.width * panel.y.size() / panel.x.size(), kLeastHeight, box.height);
  box = panel.box;
  // The same scale along both axes.
  const double metres_per_unit = std::max(panel.x.size() / box.width, panel.y.size() / box.height);
  panel.x.Grow(0.5 * (metres_per_unit * box.width - panel.x.size()));
  panel.y.Grow(0.5 * (metres_per_unit * box.height - panel.y.size()));
  return panel;
}

}  // namespace

std::string PlotTrainingReport(const TrainingReport& report, bool is_dark) {
  constexpr double kWidth = 900.0;
  constexpr double kMostHeight = 640.0;
  constexpr double kAbove = 20.0;
  constexpr double kBelow = 50.0;
  const Panel panel =
      MakePanel(report, {60.0, kAbove, kWidth - 80.0, kMostHeight - kAbove - kBelow});
  const double height = panel.box.height + kAbove + kBelow;
  Canvas canvas(kWidth, height, is_dark ? PlotTheme::Dark() : PlotTheme{}, 1.5);
  DrawAxes(canvas, panel, "x, m", "y, m");
  std::vector<cv::Point2d> path;
  for (const Eigen::Vector2d& p : report.path)
    path.push_back(panel.Pixel(p));
  canvas.Polyline(path, canvas.theme().grid, 6.0);
  std::vector<const HeldOutFrame*> frames;
  for (const HeldOutFrame& frame : report.held_out)
    frames.push_back(&frame);
  std::stable_sort(frames.begin(), frames.end(), [](const auto* a, const auto* b) {
    constexpr double kLost = 1e9;
    return a->error_m.value_or(kLost) < b->error_m.value_or(kLost);  // the bad ones on top
  });
  for (const HeldOutFrame* frame : frames)
    canvas.Dot(panel.Pixel(frame->p_W), frame->error_m ? 4.0 : 6.0, ColourOf(*frame));
  std::vector<unsigned char> png;
  cv::imencode(".png", canvas.Finish(), png);
  return {png.begin(), png.end()};
}

}  // namespace relocd
