#pragma once

#include <cstddef>

#include "relocalization/packed_correspondences.h"

namespace relocd {

/// Nearer than this, in metres, a point does not count as seen: the reprojection error says nothing
/// there.
inline constexpr float kMinDepth = 0.1F;

/// The sum of `1 / (1 + (e / threshold)^4)` over the first `count` correspondences (rounded up to a
/// multiple of kLanes), where e is the reprojection error: about the number of inliers, without a
/// step at the threshold. A point that is not in front of the camera adds nothing.
///
/// @param X_CM  the pose of the packed points' frame in the camera.
double SoftInlierScore(const PackedCorrespondences& correspondences,
                       std::size_t count,
                       const CameraFromWorld& X_CM,
                       double threshold_px);

/// The inliers in the plain sense: error below the threshold, in front of the camera.
struct InlierCount {
  std::size_t inliers = 0;
  double rms_px = 0.0;  ///< Root of the mean squared reprojection error of the inliers.
};
InlierCount CountInliers(const PackedCorrespondences& correspondences,
                         const CameraFromWorld& X_CM,
                         double threshold_px);

}  // namespace relocd
