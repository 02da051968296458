#pragma once

#include "smoothing/keyframe_window.h"

namespace relocd {

/// Moves all estimates of a window to a minimum of the squared residuals with Ceres: for a whole
/// drive, far from the minimum, and to check the chain solver by. The shares of the fixes must be
/// set.
///
/// One thread, no clock, one solver: the same window gives the same bits on each run.
///
/// @return whether the estimates are usable; if not, they are as before.
bool SolveBatch(KeyframeWindow& window, const FixWeighting& weighting, int max_iterations);

}  // namespace relocd
