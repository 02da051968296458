#include "calibration_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include "plot_canvas.h"

namespace relocd {
namespace {

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;

/// A section of the config, and its keys that a calibration may change.
struct Line {
  const char* key;
  double before;
  double after;
};

std::string FormatSection(const char* name, const std::vector<Line>& lines) {
  std::string text;
  for (const Line& line : lines) {
    if (line.before == line.after) continue;
    if (text.empty()) text = fmt::format("  {}:\n", name);
    text += fmt::format("    {}: {:.7g}  # was {:.7g}\n", line.key, line.after, line.before);
  }
  return text;
}

void Include(const std::vector<Eigen::Vector2d>& points, Range& x, Range& y) {
  for (const Eigen::Vector2d& point : points) {
    x.Include(point.x());
    y.Include(point.y());
  }
}

std::vector<cv::Point2d> Pixels(const Panel& panel, const std::vector<Eigen::Vector2d>& points) {
  std::vector<cv::Point2d> pixels;
  std::transform(points.begin(), points.end(), std::back_inserter(pixels), [&](const auto& point) {
    return panel.Pixel(point);
  });
  return pixels;
}

}  // namespace

std::string FormatParameters(const OdometryCalibration& calibration) {
  std::string text = fmt::format(
      "{} poses of the reference, {} of them far off; residuals {:.2f} "
      "standard deviations\n\n{:<20}{:>14}{:>14}{:>12}\n",
      calibration.references,
      calibration.outliers,
      calibration.residual_rms,
      "parameter",
      "before",
      "after",
      "+-");
  for (const CalibratedParameter& parameter : calibration.parameters) {
    if (parameter.is_known) {
      text += fmt::format("{:<20}{:>14.6g}{:>14.6g}{:>12.2g}\n",
                          parameter.name,
                          parameter.before,
                          parameter.after,
                          parameter.sigma);
    } else {
      text += fmt::format(
          "{:<20}{:>14.6g}  cannot be known from this drive, which leaves {:.2g} of "
          "+-{:.2g}: kept\n",
          parameter.name,
          parameter.before,
          parameter.sigma,
          parameter.expected_sigma);
    }
  }
  const DriveNoise& noise = calibration.noise;
  const auto measured = [](bool is_measured, double value, const char* unit) {
    return is_measured ? fmt::format("{:.2g} {}", value, unit)
                       : std::string("not known from this drive");
  };
  text += fmt::format(
      "\nmeasured noise: wheels {}, sideways {}, turning {}; reference {:.2g} m, {:.2g} deg\n",
      measured(calibration.has_wheel_noise, noise.wheel_sigma_m_per_sqrt_m, "m after 1 m"),
      measured(calibration.has_lateral_noise, noise.lateral_sigma_m_per_sqrt_m, "m after 1 m"),
      measured(calibration.has_turn_noise, noise.turn_sigma_rad_per_sqrt_rad, "rad after 1 rad"),
      noise.reference_sigma_m,
      noise.reference_sigma_rad * kDegreesPerRadian);
  return text;
}

std::string FormatJudgement(const DriveJudgement& before, const DriveJudgement& after) {
  std::string text = fmt::format("{:<36}{:>12}{:>12}\n",
                                 fmt::format("odometry alone, {:.1f} s to {:.1f} s, {:.1f} m",
                                             after.begin_s,
                                             after.end_s,
                                             after.length_m),
                                 "before",
                                 "after");
  const auto add = [&](const char* name, const char* unit, double was, double is) {
    text += fmt::format("  {:<38}{:>8.2f}{:>12.2f} {}\n", name, was, is, unit);
  };
  add("distance", "%", 100.0 * before.distance_error, 100.0 * after.distance_error);
  add("heading at the end",
      "deg",
      before.heading_error_rad * kDegreesPerRadian,
      after.heading_error_rad * kDegreesPerRadian);
  add("heading at worst",
      "deg",
      before.worst_heading_error_rad * kDegreesPerRadian,
      after.worst_heading_error_rad * kDegreesPerRadian);
  add("position at the end", "m", before.position_error_m, after.position_error_m);
  add("position at worst", "m", before.worst_position_error_m, after.worst_position_error_m);
  return text;
}

std::string FormatConfigLines(const OdometryConfig& before, const OdometryConfig& after) {
  const DifferentialDriveConfig& was = before.drive;
  const DifferentialDriveConfig& is = after.drive;
  const std::string sections =
      FormatSection(
          "drive",
          {{"left_radius_m", was.left_radius_m, is.left_radius_m},
           {"right_radius_m", was.right_radius_m, is.right_radius_m},
           {"left_scale", was.left_scale, is.left_scale},
           {"right_scale", was.right_scale, is.right_scale},
           {"front_left_scale", was.front_left_scale, is.front_left_scale},
           {"front_right_scale", was.front_right_scale, is.front_right_scale},
           {"track_m", was.track_m, is.track_m},
           {"wheel_sigma_m_per_sqrt_m", was.wheel_sigma_m_per_sqrt_m, is.wheel_sigma_m_per_sqrt_m},
           {"lateral_sigma_m_per_sqrt_m",
            was.lateral_sigma_m_per_sqrt_m,
            is.lateral_sigma_m_per_sqrt_m},
           {"turn_sigma_rad_per_sqrt_rad",
            was.turn_sigma_rad_per_sqrt_rad,
            is.turn_sigma_rad_per_sqrt_rad}}) +
      FormatSection("steering",
                    {{"ratio", before.steering.ratio, after.steering.ratio},
                     {"offset_rad", before.steering.offset_rad, after.steering.offset_rad},
                     {"sigma_rad", before.steering.sigma_rad, after.steering.sigma_rad}}) +
      FormatSection(
          "yaw_rate",
          {{"scale", before.yaw_rate.scale, after.yaw_rate.scale},
           {"bias_radps", before.yaw_rate.bias_radps, after.yaw_rate.bias_radps},
           {"bias_sigma_radps", before.yaw_rate.bias_sigma_radps, after.yaw_rate.bias_sigma_radps},
           {"noise_rad_per_sqrt_s",
            before.yaw_rate.noise_rad_per_sqrt_s,
            after.yaw_rate.noise_rad_per_sqrt_s}});
  return sections.empty() ? "nothing to change\n" : "odometry:\n" + sections;
}

std::string FormatUmbmark(const Umbmark& umbmark, const OdometryConfig& config) {
  OdometryConfig after = config;
  after.drive.track_m *= umbmark.track_factor;
  if (config.wheels.kind == "ticks") {
    after.drive.left_radius_m *= umbmark.left_scale;
    after.drive.right_radius_m *= umbmark.right_scale;
  } else {
    after.drive.left_scale *= umbmark.left_scale;
    after.drive.right_scale *= umbmark.right_scale;
  }
  return fmt::format(
             "centre of the errors: clockwise {:.4f} m, {:.4f} m; counter-clockwise {:.4f} m, "
             "{:.4f} "
             "m; spread {:.4f} m, {:.4f} m\n"
             "largest systematic error {:.4f} m\n"
             "corners turned {:.4f} deg too little, sides bent by {:.4f} deg\n"
             "track factor {:.6f} +- {:.2g}, right to left wheel {:.6f} +- {:.2g}\n\n",
             umbmark.centre_clockwise_m.x(),
             umbmark.centre_clockwise_m.y(),
             umbmark.centre_counter_clockwise_m.x(),
             umbmark.centre_counter_clockwise_m.y(),
             umbmark.spread_m.x(),
             umbmark.spread_m.y(),
             umbmark.largest_error_m,
             umbmark.alpha_rad * kDegreesPerRadian,
             umbmark.beta_rad * kDegreesPerRadian,
             umbmark.track_factor,
             umbmark.track_factor_sigma,
             umbmark.right_scale / umbmark.left_scale,
             umbmark.ratio_sigma) +
         FormatConfigLines(config, after);
}

Result<void> PlotCalibration(const DriveJudgement& before,
                             const DriveJudgement& after,
                             const std::string& path) {
  constexpr double kWidth = 900.0;
  constexpr double kHeight = 700.0;
  const cv::Scalar reference_colour(60, 60, 60);
  const cv::Scalar before_colour(60, 90, 220);
  const cv::Scalar after_colour(170, 110, 20);
  Canvas canvas(kWidth, kHeight);
  Panel panel{.box = cv::Rect2d(80.0, 64.0, kWidth - 110.0, kHeight - 134.0), .x = {}, .y = {}};
  for (const auto* points : {&before.odometry_m, &after.odometry_m, &after.reference_m})
    Include(*points, panel.x, panel.y);
  // One metre is as long in both directions.
  const double scale =
      std::max(panel.x.size() / panel.box.width, panel.y.size() / panel.box.height);
  panel.x.Grow(0.5 * (1.08 * scale * panel.box.width - panel.x.size()) + 0.1);
  panel.y.Grow(0.5 * (1.08 * scale * panel.box.height - panel.y.size()) + 0.1);
  DrawAxes(canvas, panel, "x (m)", "y (m)");
  canvas.Polyline(Pixels(panel, after.reference_m), reference_colour, 4.0);
  canvas.Polyline(Pixels(panel, before.odometry_m), before_colour, 2.0);
  canvas.Polyline(Pixels(panel, after.odometry_m), after_colour, 2.0);
  struct Entry {
    const char* name;
    cv::Scalar colour;
  };
  double x = panel.box.x;
  for (const Entry& entry : {Entry{"reference", reference_colour},
                             Entry{"odometry before", before_colour},
                             Entry{"odometry after", after_colour}}) {
    canvas.Line({x, 18.0}, {x + 30.0, 18.0}, entry.colour, 4.0);
    canvas.Text(entry.name, {x + 38.0, 18.0}, {.x = 0.0, .y = 0.5});
    x += 60.0 + canvas.TextWidth(entry.name);
  }
  return WritePng(canvas.Finish(), path);
}

}  // namespace relocd
