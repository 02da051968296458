#include "messaging/image_metadata.h"

#include <algorithm>
#include <string_view>
#include <type_traits>

namespace relocd {
namespace {

template <typename Number>
image_metadata_t Encode(const char* key, Number number) {
  image_metadata_t entry{};
  entry.key = key;
  entry.n = sizeof(Number);
  auto bits = static_cast<std::make_unsigned_t<Number>>(number);
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    entry.value.push_back(static_cast<std::uint8_t>(bits & 0xFFU));
    bits >>= 8U;
  }
  std::ranges::reverse(entry.value);  // big-endian, as all of LCM
  return entry;
}

template <typename Number>
std::optional<Number> Find(const image_t& message, std::string_view key) {
  for (const image_metadata_t& entry : message.metadata) {
    if (entry.key != key || entry.value.size() != sizeof(Number)) continue;
    std::make_unsigned_t<Number> bits = 0;
    for (const std::uint8_t byte : entry.value)
      bits = bits << 8U | byte;
    return static_cast<Number>(bits);
  }
  return std::nullopt;
}

}  // namespace

void SetImageMetadata(const ImageMetadata& metadata, image_t& message) {
  message.metadata = {Encode("mono_ns", metadata.mono_ns),
                      Encode("seq", metadata.seq),
                      Encode("run_id", metadata.run_id),
                      Encode("flags", metadata.flags),
                      Encode("exposure_us", metadata.exposure_us)};
  message.nmetadata = static_cast<std::int32_t>(message.metadata.size());
}

std::optional<ImageMetadata> FindImageMetadata(const image_t& message) {
  const auto mono_ns = Find<std::int64_t>(message, "mono_ns");
  const auto seq = Find<std::int64_t>(message, "seq");
  const auto run_id = Find<std::int64_t>(message, "run_id");
  if (!mono_ns || !seq || !run_id) return std::nullopt;
  const ImageMetadata defaults;
  return ImageMetadata{
      .mono_ns = *mono_ns,
      .seq = *seq,
      .run_id = *run_id,
      .flags = Find<std::int32_t>(message, "flags").value_or(defaults.flags),
      .exposure_us = Find<std::int32_t>(message, "exposure_us").value_or(defaults.exposure_us)};
}

}  // namespace relocd
