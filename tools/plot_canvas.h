#pragma once

#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "core/result.h"
#include "geometry/pose2.h"

namespace relocd {

/// The colours that carry no data, in blue, green, red.
struct PlotTheme {
  cv::Scalar background{255, 255, 255};
  cv::Scalar ink{60, 50, 45};
  cv::Scalar grid{232, 228, 226};

  /// For readers whose screen is dark.
  static PlotTheme Dark() { return {{32, 26, 22}, {222, 216, 210}, {64, 54, 48}}; }
};

/// The values along one axis.
struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void Include(double value);
  void Grow(double margin);
  [[nodiscard]] double size() const { return high - low; }
  [[nodiscard]] bool Contains(double value) const { return value >= low && value <= high; }
};

/// The point of a text that stands where it is asked to: 0 its left or top, 0.5 its middle, 1 its
/// right or bottom.
struct Anchor {
  double x = 0.0;
  double y = 1.0;
};

/// How a text looks.
struct TextStyle {
  double height = 13.0;
  double weight = 1.0;  ///< Width of a stroke.
};

/// An image that is drawn at twice its size and then halved, which smooths lines and letters. All
/// lengths and places are in units, which are `pixels_per_unit` pixels of the finished image.
class Canvas {
 public:
  Canvas(double width, double height, const PlotTheme& theme = {}, double pixels_per_unit = 1.0);

  [[nodiscard]] const PlotTheme& theme() const { return theme_; }

  void Line(cv::Point2d from, cv::Point2d to, const cv::Scalar& colour, double width);
  void Polyline(const std::vector<cv::Point2d>& corners, const cv::Scalar& colour, double width);
  void Polygon(const std::vector<cv::Point2d>& corners, const cv::Scalar& colour);
  void Rectangle(cv::Rect2d box, const cv::Scalar& colour);
  void Dot(cv::Point2d centre, double radius, const cv::Scalar& colour);
  void Text(const std::string& text, cv::Point2d at, Anchor anchor, double height = 13.0);
  void Text(const std::string& text,
            cv::Point2d at,
            Anchor anchor,
            const TextStyle& style,
            const cv::Scalar& colour);
  /// Readable over whatever is there.
  void TextWithHalo(const std::string& text, cv::Point2d at, Anchor anchor, const TextStyle& style);
  /// How wide a text is.
  [[nodiscard]] double TextWidth(const std::string& text, double height = 13.0) const;
  /// The height, at most `height`, in which a text is no wider than `width`.
  [[nodiscard]] double HeightToFit(const std::string& text, double height, double width) const;

  /// Puts a picture (CV_8UC3) into a box.
  void Picture(const cv::Mat& picture, cv::Rect2d box);

  /// Blends what `draw` draws with what is there.
  template <typename Draw>
  void Translucent(double opacity, const Draw& draw) {
    const cv::Mat before = image_.clone();
    draw();
    Blend(before, opacity);
  }

  /// Keeps only what `draw` draws inside a box.
  template <typename Draw>
  void Within(cv::Rect2d box, const Draw& draw) {
    const cv::Mat before = image_.clone();
    draw();
    RestoreOutside(before, box);
  }

  [[nodiscard]] cv::Mat Finish() const;

 private:
  [[nodiscard]] int FixedLength(double units) const;
  [[nodiscard]] cv::Point Fixed(cv::Point2d point) const;
  [[nodiscard]] int Thickness(double width) const;
  [[nodiscard]] cv::Rect Pixels(cv::Rect2d box) const;
  void Blend(const cv::Mat& before, double opacity);
  void RestoreOutside(const cv::Mat& before, cv::Rect2d box);

  PlotTheme theme_;
  double scale_;  ///< Pixels of the image that is drawn on, per unit.
  cv::Mat image_;
};

/// A rectangle of the canvas with axes of its own, y up.
struct Panel {
  cv::Rect2d box;
  Range x;
  Range y;

  [[nodiscard]] cv::Point2d Pixel(const Eigen::Vector2d& point) const;
  [[nodiscard]] bool Contains(const Eigen::Vector2d& point) const {
    return x.Contains(point.x()) && y.Contains(point.y());
  }
};

/// The round step (1, 2 or 5 times a power of ten) that divides `size` into about `count` parts.
double NiceStep(double size, double count);

/// Grid, numbers, frame and names of both axes.
void DrawAxes(Canvas& canvas,
              const Panel& panel,
              const std::string& x_label,
              const std::string& y_label);

/// A length to compare with, in the panel's lower left corner.
void DrawScale(Canvas& canvas, const Panel& panel);

/// The outline of the region that holds 95 % of the positions, as `covariance` (of the right
/// perturbation (x, y) of X_WB) says, `magnification` times its size.
std::vector<cv::Point2d> EllipsePixels(const Panel& panel,
                                       const Pose2& X_WB,
                                       const Eigen::Matrix2d& covariance,
                                       double magnification = 1.0);

/// @return kUnavailable when the file cannot be written.
Result<void> WritePng(const cv::Mat& image, const std::string& path);

}  // namespace relocd
