#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "camera/image.h"
#include "core/result.h"

namespace relocd {

/// Images with a longer side, or with more pixels, are refused before anything is allocated.
inline constexpr int kMaxImageSide = 8192;
inline constexpr std::int64_t kMaxImagePixels = 32'000'000;

/// Width and height of an image, in px.
struct JpegSize {
  int width = 0;
  int height = 0;

  friend bool operator==(const JpegSize&, const JpegSize&) = default;
};

/// An image as many cameras give it: two pixels in four bytes, Y0 U Y1 V. Borrows its bytes.
struct YuyvView {
  std::span<const std::uint8_t> bytes;
  int width = 0;           ///< px, even
  int height = 0;          ///< px
  int bytes_per_line = 0;  ///< At least 2 * width.
};

/// The JPEG in a camera's buffer, from its start marker to its end marker, without the zeros that
/// cameras pad it with; nothing when either marker is missing, which is how a transfer that was
/// cut short looks. Looks at the ends only, so it costs nothing.
std::optional<std::span<const std::uint8_t>> FindWholeJpeg(std::span<const std::uint8_t> buffer);

/// The size that the header says.
///
/// @return kInvalidInput when the bytes are no JPEG, or one above the limits of this file.
Result<JpegSize> ReadJpegSize(std::span<const std::uint8_t> jpeg);

/// The brightness of a JPEG, gray or colour, baseline or progressive, also one without Huffman
/// tables (motion JPEG). Any bytes are safe to pass.
///
/// @return kInvalidInput when it is no JPEG, is damaged or cut short, or above the limits.
Result<GrayImage> DecodeJpegToGray(std::span<const std::uint8_t> jpeg);

/// The image as YUYV without padding; its width must be even.
///
/// @return kInvalidInput as DecodeJpegToGray, and for an odd width.
Result<std::vector<std::uint8_t>> DecodeJpegToYuyv(std::span<const std::uint8_t> jpeg);

/// @param quality  1 (smallest) to 100.
/// @return kInvalidInput when the image's size does not fit its pixels or the limits of this file.
Result<std::vector<std::uint8_t>> EncodeGrayToJpeg(const GrayImage& image, int quality);
/// With half as much colour as brightness each way, as most cameras make it.
Result<std::vector<std::uint8_t>> EncodeRgbToJpeg(const RgbImage& image, int quality);
/// Keeps the camera's 4:2:2 colour and its range of values.
Result<std::vector<std::uint8_t>> EncodeYuyvToJpeg(const YuyvView& image, int quality);

/// DecodeJpegToGray of a file. Errors name the file. @return kUnavailable when it cannot be read.
Result<GrayImage> ReadGrayImage(const std::string& path);

/// A file's content as the functions of this header take it.
inline std::span<const std::uint8_t> AsBytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace relocd
