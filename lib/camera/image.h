#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace relocd {

/// An 8-bit image of one channel, owned: row-major, H x W, without padding between the rows.
struct GrayImage {
  int width = 0;   ///< px
  int height = 0;  ///< px
  std::vector<std::uint8_t> pixels;

  /// The pixels of row `v`, which must be in [0, height).
  [[nodiscard]] std::span<const std::uint8_t> Row(int v) const {
    return std::span(pixels).subspan(static_cast<std::size_t>(v) * static_cast<std::size_t>(width),
                                     static_cast<std::size_t>(width));
  }
};

/// An 8-bit sRGB image, owned: row-major, H x W x 3, without padding between the rows.
struct RgbImage {
  int width = 0;   ///< px
  int height = 0;  ///< px
  std::vector<std::uint8_t> pixels;
};

}  // namespace relocd
