#pragma once

#include <cstddef>
#include <vector>

#include "camera/dataset.h"
#include "core/result.h"
#include "map_route.h"
#include "scene_coordinates/map_file.h"

namespace relocd {

/// Measures for each region how much the covariances of its poses must grow, and from which
/// confidence poses are right, and sets it in the map.
///
/// Covariances are compared with the errors of the frames that the map was not trained on. For the
/// confidence, each region is shown frames from all along the route: mirrored ones, which look like
/// this world but show no place of it, and those from beyond its reach as they are. What it finds
/// in them is wrong.
///
/// @param route  the frames of the drives that the map was learned from, in order.
/// @return kInvalidInput when an image cannot be read.
Result<void> CalibrateRegions(const std::vector<RouteFrame>& route, int threads, SceneMap& map);

/// The confidence from which poses are believed: well above what wrong poses reach, and well below
/// what right poses have; where both are near to each other, above the wrong ones, as long as
/// hardly a right pose is refused.
double ConfidenceThreshold(const std::vector<double>& right, const std::vector<double>& wrong);

/// The frames from where nothing is seen that the region was learned from.
std::vector<DatasetFrame> FramesBeyondReach(const SceneMap& map,
                                            std::size_t region,
                                            const std::vector<DatasetFrame>& frames);

}  // namespace relocd
