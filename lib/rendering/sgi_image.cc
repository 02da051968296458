#include "rendering/sgi_image.h"

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace relocd {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t kHeaderSize = 512;
constexpr std::uint32_t kMagic = 0x01da;
constexpr std::size_t kPixelSize = 4;

struct Header {
  bool is_run_length_encoded = false;
  std::size_t width = 0;
  std::size_t height = 0;
  std::size_t channels = 0;
};

Error Invalid(std::string problem) {
  return {ErrorKind::kInvalidInput, "SGI image: " + std::move(problem)};
}

std::uint32_t BigEndian(Bytes bytes, std::size_t offset, std::size_t size) {
  std::uint32_t value = 0;
  for (const std::uint8_t byte : bytes.subspan(offset, size)) {
    value = value << 8U | byte;
  }
  return value;
}

Result<Header> ReadHeader(Bytes bytes) {
  if (bytes.size() < kHeaderSize)
    return Invalid(
        fmt::format("has {} bytes, must have a header of {}", bytes.size(), kHeaderSize));
  if (const auto magic = BigEndian(bytes, 0, 2); magic != kMagic)
    return Invalid(fmt::format("starts with {:#06x}, must with {:#06x}", magic, kMagic));
  const std::uint32_t storage = bytes[2];
  if (storage > 1)
    return Invalid(
        fmt::format("storage is {}, must be 0 (plain) or 1 (run-length encoded)", storage));
  if (bytes[3] != 1)
    return Invalid(fmt::format("has {} bytes a channel, must have 1", static_cast<int>(bytes[3])));
  const std::uint32_t dimensions = BigEndian(bytes, 4, 2);
  if (dimensions < 1 || dimensions > 3)
    return Invalid(fmt::format("has {} dimensions, must have 1, 2 or 3", dimensions));
  if (const auto colour_map = BigEndian(bytes, 104, 4); colour_map != 0)
    return Invalid(fmt::format("colour map is {}, must be 0 (none)", colour_map));
  const Header header{.is_run_length_encoded = storage == 1,
                      .width = BigEndian(bytes, 6, 2),
                      .height = dimensions > 1 ? BigEndian(bytes, 8, 2) : 1,
                      .channels = dimensions > 2 ? BigEndian(bytes, 10, 2) : 1};
  if (auto ok = CheckRgbaSize(static_cast<std::int64_t>(header.width),
                              static_cast<std::int64_t>(header.height));
      !ok)
    return std::move(ok).error().WithContext("SGI image");
  if (header.channels < 1 || header.channels > kPixelSize)
    return Invalid(fmt::format("has {} channels, must have 1 to 4", header.channels));
  return header;
}

/// One run-length encoded row of one channel. Each packet is a byte with a count in its low seven
/// bits, then that many bytes (high bit set) or one to repeat; a count of 0 ends the row.
Result<void> DecodeRow(Bytes packets, std::span<std::uint8_t> row) {
  std::size_t at = 0;
  for (std::size_t filled = 0; filled < row.size();) {
    if (at >= packets.size()) return Invalid("ends within a row");
    const std::size_t count = packets[at] & 0x7fU;
    const bool is_copy = (packets[at] & 0x80U) != 0;
    ++at;
    if (count == 0 || count > row.size() - filled)
      return Invalid(fmt::format("run of {}, must be in [1, {}]", count, row.size() - filled));
    if (packets.size() - at < (is_copy ? count : 1)) return Invalid("ends within a row");
    for (std::size_t i = 0; i < count; ++i) {
      row[filled + i] = packets[is_copy ? at + i : at];
    }
    at += is_copy ? count : 1;
    filled += count;
  }
  return {};
}

/// One row of one channel, counted from the bottom.
Result<void> ReadRow(Bytes bytes,
                     const Header& header,
                     std::size_t index,
                     std::span<std::uint8_t> row) {
  if (!header.is_run_length_encoded) {
    const std::size_t start = kHeaderSize + index * header.width;
    for (std::size_t x = 0; x < header.width; ++x) {
      row[x] = bytes[start + x];
    }
    return {};
  }
  const std::size_t start = BigEndian(bytes, kHeaderSize + 4 * index, 4);
  if (start >= bytes.size())
    return Invalid(fmt::format("starts at byte {}, must be below {}", start, bytes.size()));
  return DecodeRow(bytes.subspan(start), row);
}

/// What must be there whatever the pixels are: the pixels themselves, or where their rows start
/// and how long they are.
std::size_t SmallestSize(const Header& header) {
  const std::size_t rows = header.height * header.channels;
  return kHeaderSize + (header.is_run_length_encoded ? 8 * rows : header.width * rows);
}

void PutRow(std::span<const std::uint8_t> row,
            const Header& header,
            std::size_t channel,
            std::uint8_t* pixel) {
  const bool is_gray = header.channels <= 2;
  for (const std::uint8_t value : row) {
    if (is_gray && channel == 0) {
      pixel[0] = pixel[1] = pixel[2] = value;
    } else {
      pixel[is_gray ? 3 : channel] = value;
    }
    pixel += kPixelSize;
  }
}

}  // namespace

Result<RgbaImage> ReadSgiImage(Bytes bytes) {
  const auto header = ReadHeader(bytes);
  if (!header) return header.error();
  if (const auto size = SmallestSize(*header); bytes.size() < size)
    return Invalid(fmt::format("has {} bytes, must have at least {}", bytes.size(), size));
  RgbaImage image{
      .width = static_cast<int>(header->width),
      .height = static_cast<int>(header->height),
      .pixels = std::vector<std::uint8_t>(kPixelSize * header->width * header->height, 255)};
  std::vector<std::uint8_t> row(header->width);
  for (std::size_t channel = 0; channel < header->channels; ++channel) {
    for (std::size_t y = 0; y < header->height; ++y) {
      if (auto ok = ReadRow(bytes, *header, channel * header->height + y, row); !ok)
        return std::move(ok).error().WithContext(fmt::format("row {} of channel {}", y, channel));
      const std::size_t from_top = header->height - 1 - y;
      PutRow(row, *header, channel, &image.pixels[kPixelSize * from_top * header->width]);
    }
  }
  return image;
}

}  // namespace relocd
