#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "camera/image.h"
#include "camera/jpeg.h"

namespace relocd {

/// A smooth picture, which JPEG keeps well.
inline GrayImage MakeTestImage(int width, int height, double phase = 0.0) {
  GrayImage image{.width = width, .height = height, .pixels = {}};
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const double value = 128.0 + 60.0 * std::sin(0.11 * u + phase) + 40.0 * std::cos(0.07 * v);
      image.pixels.push_back(static_cast<std::uint8_t>(value));
    }
  }
  return image;
}

inline std::vector<std::uint8_t> MakeTestJpeg(int width, int height, int quality = 90) {
  return EncodeGrayToJpeg(MakeTestImage(width, height), quality).value();
}

}  // namespace relocd
