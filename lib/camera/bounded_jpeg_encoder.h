#pragma once

#include <cstdint>
#include <vector>

#include "camera/image.h"
#include "camera/jpeg.h"
#include "core/result.h"

namespace relocd {

/// Encodes raw images to JPEGs that stay below a size: an image that comes out larger is
/// encoded again with less quality, and the quality returns step by step when there is room.
class BoundedJpegEncoder {
 public:
  BoundedJpegEncoder(int quality, int max_bytes)
      : wanted_quality_(quality), quality_(quality), max_bytes_(max_bytes) {}

  /// An image that is too large even at the lowest quality comes out at that.
  Result<std::vector<std::uint8_t>> Encode(const YuyvView& image);
  Result<std::vector<std::uint8_t>> Encode(const GrayImage& image);
  Result<std::vector<std::uint8_t>> Encode(const RgbImage& image);

  /// Of the next image.
  [[nodiscard]] int quality() const { return quality_; }

 private:
  template <typename EncodeAt>
  Result<std::vector<std::uint8_t>> EncodeBounded(const EncodeAt& encode_at);

  int wanted_quality_;
  int quality_;
  int max_bytes_;
};

}  // namespace relocd
