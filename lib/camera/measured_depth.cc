#include "camera/measured_depth.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace relocd {

float MeasuredInverseDepth(const MeasuredDepth& depth, const Eigen::Vector2f& pixel) {
  constexpr int kReach = 1;       // pixels on each side
  constexpr int kLeastKnown = 5;  // of nine
  constexpr float kMostRatio = 1.1F;
  constexpr float kMillimetres = 1000.0F;
  if (depth.depth_mm.empty()) return 0.0F;
  const auto centre_u = static_cast<int>(std::lround(pixel.x()));
  const auto centre_v = static_cast<int>(std::lround(pixel.y()));
  int known = 0;
  float sum_mm = 0.0F;
  float least_mm = std::numeric_limits<float>::infinity();
  float most_mm = 0.0F;
  for (int v = std::max(0, centre_v - kReach); v <= std::min(depth.height - 1, centre_v + kReach);
       ++v) {
    for (int u = std::max(0, centre_u - kReach); u <= std::min(depth.width - 1, centre_u + kReach);
         ++u) {
      const auto at = static_cast<std::size_t>(v) * static_cast<std::size_t>(depth.width) +
                      static_cast<std::size_t>(u);
      const auto here_mm = static_cast<float>(depth.depth_mm[at]);
      if (here_mm == 0.0F) continue;
      ++known;
      sum_mm += here_mm;
      least_mm = std::min(least_mm, here_mm);
      most_mm = std::max(most_mm, here_mm);
    }
  }
  if (known < kLeastKnown || most_mm > kMostRatio * least_mm) return 0.0F;
  return kMillimetres * static_cast<float>(known) / sum_mm;
}

}  // namespace relocd
