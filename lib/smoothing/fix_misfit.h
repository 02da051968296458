#pragma once

#include <vector>

#include "smoothing/keyframe_window.h"

namespace relocd {

/// Measures by how much the fixes' pull on the estimates varies more than that of independent fixes
/// with the stated covariances would: errors that last, as those of a network that knows a place
/// badly, average out more slowly than their number says. Thread-bound.
class FixMisfit {
 public:
  /// @return in [1, 30]: the long-run variance of the fixes' pulls, with weights that fall
  /// exponentially with the time between two (a kernel as in Newey and West, 1987), over that
  /// expected. With few fixes it leans on what is usual for scene coordinates.
  double Estimate(const KeyframeWindow& window, const FixWeighting& weighting);

 private:
  double ScatterFactor();

  std::vector<double> squared_;  ///< Kept, so that it is allocated once.
};

}  // namespace relocd
