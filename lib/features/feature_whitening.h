#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/result.h"

namespace relocd {

/// A linear map of features to fewer dimensions of unit variance: `(feature - mean) * basis`.
struct FeatureWhitening {
  int inputs = 0;
  int outputs = 0;
  std::vector<float> mean;   ///< inputs
  std::vector<float> basis;  ///< inputs x outputs, row-major, scaled by the standard deviations.

  /// The same map as `feature * basis + offset`. @return outputs values.
  [[nodiscard]] std::vector<float> Offset() const;

  /// @param features  n x inputs; @param whitened  n x outputs. The plain form; the daemon runs it
  /// as a layer of its network.
  void Apply(std::span<const float> features, std::span<float> whitened) const;
};

/// The principal components with the most variance of `features` (n x inputs, row-major).
///
/// Directions that carry next to no variance are not blown up to full size: their noise would drown
/// the rest.
///
/// @return kInvalidInput when there are fewer samples than dimensions, or one is not finite.
Result<FeatureWhitening> FitWhitening(std::span<const float> features, int inputs, int outputs);

}  // namespace relocd
