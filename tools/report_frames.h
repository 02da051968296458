#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "report_numbers.h"

namespace relocd {

/// One image of the drive, and how well the vehicle knew then where it was.
struct ReportFrame {
  double time_s = 0.0;
  std::string jpeg;        ///< Made small enough for a page.
  std::string teach_jpeg;  ///< Of the teach drive from the same place; empty: none.
  double teach_distance_m = 0.0;
  std::string camera_status;  ///< Empty when the camera's table has no row for it.
  std::optional<double> camera_error_m;
  std::optional<double> confidence;
  std::optional<double> fused_error_m;
  std::string status;  ///< Of LOCALIZATION.
};

/// Where the images are.
struct FrameSources {
  std::string dataset;        ///< Empty: from the log.
  std::string teach_dataset;  ///< Empty: none; else in the same world as `dataset`, which it needs.
  std::string log;
  std::int64_t time_origin_ns = 0;  ///< Of the log.
};

/// Up to `count` images, evenly over the drive; none without a source.
///
/// @return kInvalidInput when an image or a data set cannot be read.
Result<std::vector<ReportFrame>> CollectFrames(const DriveReport& report,
                                               const FrameSources& sources,
                                               std::size_t count);

}  // namespace relocd
