#pragma once

#include <cstdint>
#include <optional>

#include "geometry/pose2.h"
#include "smoothing/consensus.h"
#include "smoothing/keyframe_window.h"

namespace relocd {

/// A stretch over which the odometry was wrong, as while wheels slip.
struct OdometryBreak {
  std::int64_t last_before = 0;  ///< The keyframe of the last fix that supports the estimates.
  std::int64_t first_after = 0;  ///< That of the first fix that supports X_WO.
  Pose2 X_WO;                    ///< Since then.
};

/// The break after which the newest fixes agree with each other, but not with the estimates.
///
/// Other than a place that looks alike, a break ends where the body can have driven meanwhile: at
/// no more than one and a half times the greatest speed that the odometry has in the window. So the
/// fixes since then suffice to tell.
///
/// @return nothing where there is none, at the cost of looking at a few fixes.
std::optional<OdometryBreak> FindOdometryBreak(const KeyframeWindow& window,
                                               const ConsensusOptions& options);

/// Puts the motions over the break right, as uncertain as they were wrong, moves the estimates
/// since then to where the fixes have them, and takes these in again.
void MendOdometryBreak(const OdometryBreak& found, KeyframeWindow& window);

}  // namespace relocd
