#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace relocd {

/// What a depth camera saw in the pixels of an image, owned: row-major, H x W.
struct MeasuredDepth {
  int width = 0;                        ///< px
  int height = 0;                       ///< px
  std::vector<std::uint16_t> depth_mm;  ///< Along the camera's z axis; 0 where it is not known.
};

/// One over the depth that was measured at a place of the image, in 1/m.
///
/// It is the mean of the pixels around. 0 where too few of them are known or where they differ: at
/// the edge of a thing, nobody knows which side the place belongs to.
///
/// @param depth  may be empty: nothing is known then.
float MeasuredInverseDepth(const MeasuredDepth& depth, const Eigen::Vector2f& pixel);

}  // namespace relocd
