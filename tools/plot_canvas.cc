#include "plot_canvas.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "geometry/covariance.h"

namespace relocd {
namespace {

constexpr double kSupersampling = 2.0;
constexpr int kShift = 4;  // bits behind the point in cv's coordinates
constexpr double kHersheyHeight = 22.0;
constexpr double kFontHeight = 13.0;

/// Without the dust of adding steps: 0 and not 1e-17.
std::string TickLabel(double value, double step) {
  const int decimals = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  const double rounded = std::round(value / step) * step;
  return fmt::format("{:.{}f}", rounded == 0.0 ? 0.0 : rounded, decimals);
}

/// The multiples of `step` within a range, at most a hundred.
std::vector<double> Multiples(double step, const Range& range) {
  constexpr int kMost = 100;
  const double first = std::ceil(range.low / step);
  std::vector<double> multiples;
  for (int i = 0; i < kMost && (first + i) * step <= range.high; ++i)
    multiples.push_back((first + i) * step);
  return multiples;
}

}  // namespace

void Range::Include(double value) {
  low = std::min(low, value);
  high = std::max(high, value);
}

void Range::Grow(double margin) {
  low -= margin;
  high += margin;
}

Canvas::Canvas(double width, double height, const PlotTheme& theme, double pixels_per_unit)
    : theme_(theme),
      scale_(kSupersampling * pixels_per_unit),
      image_(static_cast<int>(height * scale_),
             static_cast<int>(width * scale_),
             CV_8UC3,
             theme.background) {}

void Canvas::Line(cv::Point2d from, cv::Point2d to, const cv::Scalar& colour, double width) {
  cv::line(image_, Fixed(from), Fixed(to), colour, Thickness(width), cv::LINE_AA, kShift);
}

void Canvas::Polyline(const std::vector<cv::Point2d>& corners,
                      const cv::Scalar& colour,
                      double width) {
  for (std::size_t i = 1; i < corners.size(); ++i)
    Line(corners[i - 1], corners[i], colour, width);
}

void Canvas::Polygon(const std::vector<cv::Point2d>& corners, const cv::Scalar& colour) {
  std::vector<cv::Point> fixed;
  fixed.reserve(corners.size());
  for (const cv::Point2d& corner : corners)
    fixed.push_back(Fixed(corner));
  cv::fillPoly(image_, std::vector{fixed}, colour, cv::LINE_AA, kShift);
}

void Canvas::Rectangle(cv::Rect2d box, const cv::Scalar& colour) {
  cv::rectangle(image_, Fixed(box.tl()), Fixed(box.br()), colour, cv::FILLED, cv::LINE_AA, kShift);
}

void Canvas::Dot(cv::Point2d centre, double radius, const cv::Scalar& colour) {
  cv::circle(image_, Fixed(centre), FixedLength(radius), colour, cv::FILLED, cv::LINE_AA, kShift);
}

void Canvas::Text(const std::string& text, cv::Point2d at, Anchor anchor, double height) {
  Text(text, at, anchor, {.height = height}, theme_.ink);
}

void Canvas::Text(const std::string& text,
                  cv::Point2d at,
                  Anchor anchor,
                  const TextStyle& style,
                  const cv::Scalar& colour) {
  const double font_scale = style.height * scale_ / kHersheyHeight;
  const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, font_scale, 1, nullptr);
  const cv::Point origin(
      static_cast<int>(std::lround(at.x * scale_ - anchor.x * size.width)),
      static_cast<int>(std::lround(at.y * scale_ + (1.0 - anchor.y) * size.height)));
  cv::putText(image_,
              text,
              origin,
              cv::FONT_HERSHEY_SIMPLEX,
              font_scale,
              colour,
              Thickness(style.weight),
              cv::LINE_AA);
}

void Canvas::TextWithHalo(const std::string& text,
                          cv::Point2d at,
                          Anchor anchor,
                          const TextStyle& style) {
  constexpr double kHalo = 3.6;
  Text(text,
       at,
       anchor,
       {.height = style.height, .weight = style.weight + kHalo},
       theme_.background);
  Text(text, at, anchor, style, theme_.ink);
}

double Canvas::TextWidth(const std::string& text, double height) const {
  const double font_scale = height * scale_ / kHersheyHeight;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, font_scale, 1, nullptr).width / scale_;
}

double Canvas::HeightToFit(const std::string& text, double height, double width) const {
  return height * std::min(1.0, width / std::max(1.0, TextWidth(text, height)));
}

void Canvas::Picture(const cv::Mat& picture, cv::Rect2d box) {
  const cv::Rect whole = Pixels(box);
  const cv::Rect visible = whole & cv::Rect({}, image_.size());
  if (visible.empty()) return;
  // Only what is seen is scaled: the box may be far larger than the canvas.
  const double x_scale = static_cast<double>(picture.cols) / whole.width;
  const double y_scale = static_cast<double>(picture.rows) / whole.height;
  cv::Matx23d to_picture(x_scale,
                         0.0,
                         x_scale * (visible.x - whole.x + 0.5) - 0.5,
                         0.0,
                         y_scale,
                         y_scale * (visible.y - whole.y + 0.5) - 0.5);
  cv::Mat scaled;
  cv::warpAffine(picture,
                 scaled,
                 to_picture,
                 visible.size(),
                 cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REPLICATE);
  scaled.copyTo(image_(visible));
}

cv::Mat Canvas::Finish() const {
  cv::Mat finished;
  cv::resize(image_, finished, {}, 1.0 / kSupersampling, 1.0 / kSupersampling, cv::INTER_AREA);
  return finished;
}

int Canvas::FixedLength(double units) const {
  return static_cast<int>(std::lround(units * scale_ * (1 << kShift)));
}

cv::Point Canvas::Fixed(cv::Point2d point) const {
  return {FixedLength(point.x), FixedLength(point.y)};
}

int Canvas::Thickness(double width) const {
  return std::max(1, static_cast<int>(std::lround(width * scale_)));
}

cv::Rect Canvas::Pixels(cv::Rect2d box) const {
  const cv::Point low(cvRound(box.x * scale_), cvRound(box.y * scale_));
  const cv::Point high(cvRound(box.br().x * scale_), cvRound(box.br().y * scale_));
  return {low, high};
}

void Canvas::Blend(const cv::Mat& before, double opacity) {
  cv::addWeighted(image_, opacity, before, 1.0 - opacity, 0.0, image_);
}

void Canvas::RestoreOutside(const cv::Mat& before, cv::Rect2d box) {
  const cv::Rect inside = Pixels(box) & cv::Rect({}, image_.size());
  const cv::Mat drawn = image_(inside).clone();
  before.copyTo(image_);
  drawn.copyTo(image_(inside));
}

cv::Point2d Panel::Pixel(const Eigen::Vector2d& point) const {
  return {box.x + box.width * (point.x() - x.low) / x.size(),
          box.y + box.height * (y.high - point.y()) / y.size()};
}

double NiceStep(double size, double count) {
  const double raw = size / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (raw <= factor * power) return factor * power;
  }
  return 10.0 * power;
}

void DrawAxes(Canvas& canvas,
              const Panel& panel,
              const std::string& x_label,
              const std::string& y_label) {
  constexpr double kTickDistance = 90.0;
  constexpr double kRowDistance = 45.0;
  constexpr double kFewestRows = 5.0;  // a round step may be 2.5 times as long: two are left
  constexpr double kGap = 8.0;
  const cv::Rect2d& box = panel.box;
  const cv::Scalar& grid = canvas.theme().grid;
  const double x_step = NiceStep(panel.x.size(), box.width / kTickDistance);
  for (const double x : Multiples(x_step, panel.x)) {
    const double u = panel.Pixel({x, panel.y.low}).x;
    canvas.Line({u, box.y}, {u, box.br().y}, grid, 1.0);
    canvas.Text(TickLabel(x, x_step), {u, box.br().y + kGap}, {0.5, 0.0});
  }
  const double y_step = NiceStep(panel.y.size(), std::max(kFewestRows, box.height / kRowDistance));
  for (const double y : Multiples(y_step, panel.y)) {
    const double v = panel.Pixel({panel.x.low, y}).y;
    canvas.Line({box.x, v}, {box.br().x, v}, grid, 1.0);
    canvas.Text(TickLabel(y, y_step), {box.x - kGap, v}, {1.0, 0.5});
  }
  const std::vector<cv::Point2d> frame{
      box.tl(), {box.br().x, box.y}, box.br(), {box.x, box.br().y}, box.tl()};
  canvas.Polyline(frame, canvas.theme().ink, 0.7);
  canvas.Text(
      x_label, {box.x + 0.5 * box.width, box.br().y + 2.0 * kGap + kFontHeight}, {0.5, 0.0});
  canvas.Text(y_label, {box.x, box.y - kGap}, {0.0, 1.0});
}

void DrawScale(Canvas& canvas, const Panel& panel) {
  constexpr double kPart = 8.0;  // of the panel's width
  constexpr double kInset = 22.0;
  constexpr double kEnd = 5.0;
  const cv::Scalar& ink = canvas.theme().ink;
  const double length = NiceStep(panel.x.size(), kPart);
  const double pixels = panel.box.width * length / panel.x.size();
  const cv::Point2d left(panel.box.x + kInset, panel.box.br().y - kInset);
  const cv::Point2d right(left.x + pixels, left.y);
  canvas.Line(left, right, ink, 1.2);
  canvas.Line({left.x, left.y - kEnd}, {left.x, left.y + kEnd}, ink, 1.2);
  canvas.Line({right.x, right.y - kEnd}, {right.x, right.y + kEnd}, ink, 1.2);
  canvas.Text(
      fmt::format("{:g} m", length), {0.5 * (left.x + right.x), left.y - kEnd - 2.0}, {0.5, 1.0});
}

std::vector<cv::Point2d> EllipsePixels(const Panel& panel,
                                       const Pose2& X_WB,
                                       const Eigen::Matrix2d& covariance,
                                       double magnification) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance);
  const Eigen::Matrix2d root = magnification * std::sqrt(kChiSquared95Dof2) * axes.eigenvectors() *
                               axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  constexpr int kCorners = 48;
  std::vector<cv::Point2d> corners;
  for (int i = 0; i <= kCorners; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kCorners;
    const Eigen::Vector2d point = root * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    corners.push_back(panel.Pixel(X_WB * point));
  }
  return corners;
}

Result<void> WritePng(const cv::Mat& image, const std::string& path) {
  try {
    if (cv::imwrite(path, image)) return {};
  } catch (const cv::Exception& exception) {
    return Error{ErrorKind::kUnavailable, fmt::format("writing {}: {}", path, exception.err)};
  }
  return Error{ErrorKind::kUnavailable, fmt::format("writing {}: failed", path)};
}

}  // namespace relocd
