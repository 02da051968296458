#pragma once

#include <cstddef>

#include "geometry/pose3.h"
#include "relocalization/packed_correspondences.h"

namespace relocd {

/// How a pose is refined. The threshold is where a residual's influence begins to fade; it shrinks
/// from `start` to `end` in geometric steps, so that a rough start is not caught by its own errors.
struct RefinementSchedule {
  int steps = 12;
  double start_threshold_px = 20.0;
  double end_threshold_px = 5.0;
};

/// A pose at which the robust reprojection error is least.
struct RefinedPose {
  CameraFromWorld X_CM;
  /// The equations do not determine the pose: `covariance` is meaningless.
  bool degenerate = false;
  /// 6x6 of the left perturbation (translation, rotation) of X_CM, which is that of the right
  /// perturbation of its inverse; m and rad. True when the errors of the correspondences are
  /// independent of each other.
  Matrix6d covariance = Matrix6d::Zero();
};

/// Iteratively reweighted Gauss-Newton over the first `count` correspondences (rounded up to a
/// multiple of kLanes) with the kernel of Geman and McClure, weight `1 / (1 + (e /
/// threshold)^2)^2`.
///
/// The covariance is the inverse of the last Hessian, scaled by the residuals' variance as a robust
/// estimator sees it: P. J. Huber, "Robust Statistics", 1981, section 7.6.
RefinedPose RefinePose(const PackedCorrespondences& correspondences,
                       std::size_t count,
                       const CameraFromWorld& X_CM,
                       const RefinementSchedule& schedule);

}  // namespace relocd
