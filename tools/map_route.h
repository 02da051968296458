#pragma once

#include <cstddef>
#include <vector>

#include "camera/dataset.h"
#include "core/result.h"
#include "map_dataset.h"

namespace relocd {

/// A frame of one of several drives along the same route.
struct RouteFrame {
  DatasetFrame frame;
  std::size_t drive = 0;     ///< Which of the drives it is of.
  double along_m = 0.0;      ///< How far along the first drive it was taken.
  bool is_held_out = false;  ///< Measures the map, never trains it.
};

/// The frames of one stretch of the route: those of a drive next to each other, in their order.
struct RegionFrames {
  std::vector<RouteFrame> training;
  std::vector<RouteFrame> held_out;
};

/// The frames of all drives, by how far along the first drive each was taken. Frames of the others
/// belong where the first drive's camera stood and looked most alike.
///
/// @param held_out_every  of each drive, one frame of so many is held out.
/// @return kInvalidInput when a drive's world or camera is not the first one's, or it leaves the
///         route of the first.
Result<std::vector<RouteFrame>> PlaceOnRoute(const std::vector<SelectedFrames>& drives,
                                             int held_out_every);

/// Divides the route into stretches of equal length, at most `length_m`, that overlap.
std::vector<RegionFrames> DivideRoute(const std::vector<RouteFrame>& frames,
                                      double length_m,
                                      double overlap_m);

}  // namespace relocd
