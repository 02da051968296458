#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "relocalization/packed_correspondences.h"

namespace relocd {

/// A pose that some of the correspondences suggest, and how many support it.
struct PoseHypothesis {
  CameraFromWorld X_CM;
  double score = 0.0;     ///< SoftInlierScore.
  std::size_t order = 0;  ///< When it was drawn: of equal scores the earlier counts as the better.
};

bool IsBetter(const PoseHypothesis& a, const PoseHypothesis& b);

struct PoseRansacOptions {
  int hypotheses = 64;         ///< Poses wanted.
  int max_tries = 6000;        ///< Minimal sets drawn at most: what bounds the time on garbage.
  int kept = 8;                ///< Poses given back.
  int scored_points = 600;     ///< Correspondences that each hypothesis is scored on.
  double threshold_px = 10.0;  ///< Of the score, and of the fourth point.
};

struct PoseRansacResult {
  /// The best ones, best first, scored on all correspondences.
  std::vector<PoseHypothesis> best;
  int hypotheses = 0;
  int tries = 0;
  int degenerate_tries = 0;  ///< Sets of points that no pose, or no single one, follows from.
};

/// Preemptive RANSAC: draws four correspondences, solves for the pose with three, and takes it for
/// a hypothesis if the fourth agrees. All hypotheses are scored on a random subset, the best ones
/// on all.
///
/// The result is a function of the arguments: limits are counts, never times.
///
/// @param more  hypotheses from elsewhere, scored with the drawn ones.
PoseRansacResult FindPoses(const PackedCorrespondences& correspondences,
                           const PoseRansacOptions& options,
                           const std::vector<CameraFromWorld>& more,
                           std::uint64_t seed);

}  // namespace relocd
