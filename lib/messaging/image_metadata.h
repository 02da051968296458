#pragma once

#include <cstdint>
#include <optional>

#include "relocd/image_t.hpp"

namespace relocd {

/// What bot_core's image message has no field for, and what estimation needs.
struct ImageMetadata {
  std::int64_t mono_ns = 0;       ///< ns, CLOCK_MONOTONIC when the image was taken.
  std::int64_t seq = 0;           ///< 0, 1, 2, ... since the start of the publisher.
  std::int64_t run_id = 0;        ///< Random per start of the publisher.
  std::int32_t flags = 0;         ///< Bits of FrameFlag (camera/frame_source.h).
  std::int32_t exposure_us = -1;  ///< us, -1 when unknown.

  friend bool operator==(const ImageMetadata&, const ImageMetadata&) = default;
};

/// Replaces the message's metadata.
void SetImageMetadata(const ImageMetadata& metadata, image_t& message);

/// The message's metadata, or nothing when mono_ns, seq or run_id is missing or of another size.
std::optional<ImageMetadata> FindImageMetadata(const image_t& message);

}  // namespace relocd
