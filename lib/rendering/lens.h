#pragma once

#include <cstdint>
#include <vector>

#include "rendering/linear_image.h"

namespace relocd {

/// What is on the lens and in the air right in front of it: dirt that stays, drops that come and
/// are wiped away, streaks of falling rain. Immutable, hence thread-safe.
class Lens {
 public:
  /// @param dirt  in [0, 1], 0: clean.
  /// @param rain  in [0, 1], 0: dry.
  Lens(int width, int height, double dirt, double rain, std::uint64_t seed);

  /// Changes the image as the lens does at a time since the drive's begin.
  void Apply(LinearImage& image, double time_s, std::uint64_t frame_seed) const;

 private:
  void ApplyDirt(LinearImage& image) const;
  void ApplyDrops(LinearImage& image, double time_s) const;
  void ApplyStreaks(LinearImage& image, std::uint64_t frame_seed) const;

  int width_;
  int height_;
  double rain_;
  std::uint64_t seed_;
  std::vector<float> opacity_;  ///< H x W; empty for a clean lens.
};

}  // namespace relocd
