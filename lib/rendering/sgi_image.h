#pragma once

#include <cstdint>
#include <span>

#include "core/result.h"
#include "rendering/rgba_image.h"

namespace relocd {

/// Reads an image in Silicon Graphics' format (.rgb, .rgba, .sgi, .bw): one byte a channel, stored
/// plainly or run-length encoded, with 1 (gray), 2 (gray and coverage), 3 or 4 channels. Any bytes
/// are safe to pass.
///
/// @return kInvalidInput for what is no such image, is damaged or cut short, or above the limits
///         of CheckRgbaSize.
Result<RgbaImage> ReadSgiImage(std::span<const std::uint8_t> bytes);

}  // namespace relocd
