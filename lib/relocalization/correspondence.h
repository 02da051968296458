#pragma once

#include <Eigen/Core>

namespace relocd {

/// A scene coordinate: a pixel, and the point of the world that is believed to be seen there.
struct Correspondence {
  Eigen::Vector2d pixel;    ///< (u, v) in the image as it is, distortion and all.
  Eigen::Vector3d p_WP;     ///< m.
  float confidence = 1.0F;  ///< In [0, 1], that it is right: only compared with that of others.
};

}  // namespace relocd
