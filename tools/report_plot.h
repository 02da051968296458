#pragma once

#include <array>
#include <string>

#include <opencv2/core.hpp>

#include "core/result.h"
#include "plot_canvas.h"
#include "report_numbers.h"

namespace relocd {

/// The colours of what a report compares; they differ for people who see few colours too (Okabe and
/// Ito). In blue, green, red.
struct ReportColours {
  cv::Scalar truth{178, 168, 160};
  cv::Scalar odometry{0, 94, 213};
  cv::Scalar camera{200, 128, 40};
  cv::Scalar outlier{96, 24, 190};
  cv::Scalar fused{110, 150, 0};

  static ReportColours Dark() {
    return {{132, 122, 114}, {66, 140, 255}, {255, 186, 110}, {178, 108, 255}, {160, 214, 50}};
  }
};

/// How a figure looks.
struct FigureStyle {
  PlotTheme theme;
  ReportColours colours;

  static FigureStyle Dark() {
    return {.theme = PlotTheme::Dark(), .colours = ReportColours::Dark()};
  }
};

/// A picture of the ground, and what of W it shows.
struct TopView {
  cv::Mat picture;  ///< Empty: there is none.
  Range x;          ///< m, left to right.
  Range y;          ///< m, bottom to top.
};

/// @param extent_m  left, bottom, right, top.
/// @return kInvalidInput when there is no such picture, or the extent is empty.
Result<TopView> ReadTopView(const std::string& path, const std::array<double, 4>& extent_m);

/// The drive from above: truth, odometry, camera and fused, reported ellipses, and the places of
/// the largest and of the median error from near.
cv::Mat DrawDrive(const DriveReport& report, const TopView& top_view, const FigureStyle& style);

/// The errors of position and heading over time, with what was reported of them.
cv::Mat DrawErrors(const DriveReport& report, const FigureStyle& style);

}  // namespace relocd
