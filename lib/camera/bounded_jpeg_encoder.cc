#include "camera/bounded_jpeg_encoder.h"

#include <algorithm>
#include <iterator>

namespace relocd {
namespace {

constexpr int kLowestQuality = 10;  // below, the blocks show more than the scene
constexpr int kStepDown = 10;
/// An image this much smaller than the limit lets the quality rise by one: about 2 % more bytes.
constexpr double kRoomToRise = 0.9;

}  // namespace

template <typename EncodeAt>
Result<std::vector<std::uint8_t>> BoundedJpegEncoder::EncodeBounded(const EncodeAt& encode_at) {
  while (true) {
    auto jpeg = encode_at(quality_);
    if (!jpeg) return jpeg;
    const auto size = std::ssize(*jpeg);
    if (size <= max_bytes_ || quality_ <= kLowestQuality) {
      const bool has_room = static_cast<double>(size) < kRoomToRise * max_bytes_;
      if (has_room) quality_ = std::min(wanted_quality_, quality_ + 1);
      return jpeg;
    }
    quality_ = std::max(kLowestQuality, quality_ - kStepDown);
  }
}

Result<std::vector<std::uint8_t>> BoundedJpegEncoder::Encode(const YuyvView& image) {
  return EncodeBounded([&](int quality) { return EncodeYuyvToJpeg(image, quality); });
}

Result<std::vector<std::uint8_t>> BoundedJpegEncoder::Encode(const GrayImage& image) {
  return EncodeBounded([&](int quality) { return EncodeGrayToJpeg(image, quality); });
}

Result<std::vector<std::uint8_t>> BoundedJpegEncoder::Encode(const RgbImage& image) {
  return EncodeBounded([&](int quality) { return EncodeRgbToJpeg(image, quality); });
}

}  // namespace relocd
