#pragma once

#include <optional>
#include <span>

#include "geometry/pose2.h"
#include "smoothing/fix.h"

namespace relocd {

/// A fix, and where the odometry says that the body was at its time.
struct ConsensusFix {
  Pose2 X_OB;
  Pose2 X_WB;  ///< As measured; without a heading its yaw means nothing.
  bool has_heading = false;
  double sigma_m = 0.0;
  double heading_sigma_rad = 0.0;
};

/// A fix at a time at which the odometry says that the body was at X_OB.
ConsensusFix ToConsensusFix(const Fix& fix, const Pose2& X_OB);

/// How near a fix must be to a pose to support it: within a number of its own standard deviations,
/// but no less than a radius that allows for the drift of the odometry between the fixes.
struct ConsensusOptions {
  double radius_sigmas = 4.3;
  double min_radius_m = 0.5;
};

/// Where many fixes agree that the odometry frame lies in the map.
struct Consensus {
  Pose2 X_WO;
  int supporters = 0;
  double heading_sigma_rad = 0.0;  ///< Of X_WO, as if the supporters erred independently.
};

bool Supports(const ConsensusFix& fix, const Pose2& X_WB, const ConsensusOptions& options);

int CountSupporters(std::span<const ConsensusFix> fixes,
                    const Pose2& X_WO,
                    const ConsensusOptions& options);

/// The X_WO that the fixes agree on best under a Cauchy cost.
///
/// Each fix with a heading proposes one; of those without, each pair does that is far enough apart
/// in the odometry frame for its direction to mean something. So the right one is found among any
/// number of wrong fixes that do not agree with each other. Costs a vote for each proposal and fix:
/// 60 positions make 1,800 proposals and 0.1 million votes.
///
/// @return nothing when nothing is proposed, as from positions taken at one place.
std::optional<Consensus> FindConsensus(std::span<const ConsensusFix> fixes,
                                       const ConsensusOptions& options);

}  // namespace relocd
