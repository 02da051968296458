#pragma once

#include <limits>

#include "geometry/pose3.h"
#include "scene_coordinates/map_file.h"

namespace relocd {

/// The training pose of a region that is nearest to a pose, in the plane, among those that look
/// within an angle of its way.
struct NearestPlace {
  double distance_m = std::numeric_limits<double>::infinity();  ///< Infinite: there is none.
  double height_m = 0.0;                                        ///< Of the training pose, W's z.
};

NearestPlace FindNearestPlace(const MapRegion& region, const Pose3& X_WC, double max_turn_rad);

/// Whether a camera of this pose can see what the region was learned from. Heads are functions that
/// give points for any image; a pose of them that is far from where they were trained is none.
bool IsNearTraining(const MapRegion& region, const Pose3& X_WC);

}  // namespace relocd
