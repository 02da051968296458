#pragma once

#include <vector>

#include "smoothing/keyframe_window.h"

namespace relocd {

/// How the fixes err, against their covariances.
struct FixErrors {
  double scatter =
      1.0;  ///< The variance of one fix over that expected; below 1 where it says less.
  /// The long-run variance of the fixes' pulls on the estimates over that of independent fixes with
  /// the stated covariances, in [1, 30]: errors that last, as those of a network that knows a place
  /// badly, average out more slowly than their number says.
  double misfit = 1.0;
};

/// Measures how the fixes of a window err, by the window's estimates. Thread-bound.
class FixMisfit {
 public:
  /// The long-run variance has weights that fall exponentially with the time between two fixes (a
  /// kernel as in Newey and West, 1987). With few fixes it leans on what is usual for scene
  /// coordinates, and the scatter on 1.
  FixErrors Measure(const KeyframeWindow& window, const FixWeighting& weighting);

 private:
  double Scatter();

  std::vector<double> squared_;  ///< Kept, so that it is allocated once.
};

}  // namespace relocd
