#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "camera/dataset.h"
#include "core/result.h"

namespace relocd {

/// What an image shows of itself.
struct ImageQuality {
  bool looked_at = false;  ///< The rest holds only then.
  double blur_px = 0.0;    ///< Standard deviation of the blur at edges, along u or v.
  /// Energy of brightness steps against that of all brightness, in the direction with less of it: a
  /// smear takes most of it away.
  double sharpness = 0.0;
  double dark_level = 0.0;   ///< Gray that 5 % of the pixels are below,
  double mean_level = 0.0;   ///< the mean,
  double light_level = 0.0;  ///< and that 5 % are above; in [0, 255].
  int corners = 0;           ///< Followed from the image before, or found anew.
  /// Median motion of corners since the image before; negative where it could not be measured.
  double motion_px = -1.0;
};

/// Where a corner was seen.
struct CornerView {
  std::uint32_t frame = 0;  ///< Of the data set, as it was passed.
  Eigen::Vector2f ray;      ///< The viewing ray is (x, y, 1) in C.
};

/// One corner in consecutive views. Images in which next to nothing moved are no views.
using CornerTrack = std::vector<CornerView>;

/// What all corners of a drive did.
struct TrackedDrive {
  std::vector<ImageQuality> images;  ///< One a frame.
  std::vector<CornerTrack> tracks;   ///< Of two or more views.
  std::size_t images_looked_at = 0;
};

struct CornerTrackingOptions {
  int threads = 1;  ///< The result does not depend on it.
  /// Of long drives, stretches are looked at that have together so many pixels.
  double pixel_budget = 250e6;
};

/// Follows corners from image to image (B. Lucas and T. Kanade, 1981, in pyramids), there and back.
///
/// @return kInvalidInput when an image cannot be read or has not the size of the intrinsics.
Result<TrackedDrive> TrackCorners(const Dataset& dataset,
                                  const CornerTrackingOptions& options,
                                  const std::function<void(double)>& progress);

}  // namespace relocd
