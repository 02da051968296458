#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "camera/dataset.h"

namespace relocd {

/// How bad it is.
enum class InputSeverity {
  kWarning,  ///< A map can be made, a worse one than could be.
  kRefusal,  ///< A map of this would be wrong, or cannot be made.
};

/// One thing that is wrong with a data set.
struct InputFinding {
  InputSeverity severity = InputSeverity::kWarning;
  std::string about;    ///< One word: `poses`, `images`, `focal`, ...
  std::string message;  ///< One line: what, where (names of images), and what to do.
};

/// What was measured on the way, for people who want to judge themselves. Lengths are in the
/// poses' unit, which is to be the metre.
struct InputSummary {
  std::size_t frames = 0;
  double route_m = 0.0;
  double duration_s = 0.0;
  double median_step_m = 0.0;  ///< Between images, while the camera moves.
  std::size_t images_looked_at = 0;
  double blur_px = 0.0;        ///< Median; standard deviation.
  double corners = 0.0;        ///< Median of an image.
  std::size_t segments = 0;    ///< Pieces of corner tracks that the poses were held against.
  double tolerance_px = 0.0;   ///< Within which
  double fitting_share = 0.0;  ///< so many of them fit.
  double parallax_deg = 0.0;   ///< Median, over the few views of a segment.
  double depth_m = 0.0;        ///< Median distance of the corners.
  std::optional<double> camera_height_m;  ///< Above what is seen below the horizon.
  /// Depths of the depth images over those that follow from the poses, in the median.
  std::optional<double> depth_factor;
  std::optional<double> focal_factor;  ///< At which the corners fit best, if that can be told.
};

struct InputCheck {
  InputSummary summary;
  std::vector<InputFinding> findings;  ///< Refusals first.

  [[nodiscard]] bool IsRefused() const;
};

struct InputCheckOptions {
  int threads = 2;
  std::function<void(double)> progress = [](double) {};
};

/// Whether a data set can make a good map, by its files, its images, and by holding its poses
/// against corners that are followed through the images.
InputCheck CheckInput(const Dataset& dataset, const InputCheckOptions& options);

/// The summary and the findings as lines, each beginning with `name`.
std::string FormatInputCheck(const InputCheck& check, const std::string& name);

}  // namespace relocd
