#pragma once

#include <cstdint>
#include <vector>

#include "core/result.h"

namespace relocd {

/// An 8-bit sRGB image with straight (not premultiplied) coverage, owned: row-major, the top row
/// first, H x W x 4, without padding between the rows.
struct RgbaImage {
  int width = 0;   ///< px
  int height = 0;  ///< px
  std::vector<std::uint8_t> pixels;
};

/// @return kInvalidInput unless both sides are in [1, kMaxImageSide] and the pixels are at most
///         kMaxImagePixels, the limits of camera/jpeg.h. To be asked before anything is allocated.
Result<void> CheckRgbaSize(std::int64_t width, std::int64_t height);

/// The image with both sides the nearest powers of two up to `max_side`, linearly interpolated or
/// averaged, which is what textures are made of; unchanged where they are that already.
RgbaImage ResampleToPowersOfTwo(RgbaImage image, int max_side);

}  // namespace relocd
