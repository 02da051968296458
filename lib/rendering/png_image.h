#pragma once

#include <cstdint>
#include <span>

#include "core/result.h"
#include "rendering/rgba_image.h"

namespace relocd {

/// Reads a PNG of any colour type and depth. Any bytes are safe to pass.
///
/// @return kInvalidInput for what is no PNG, is damaged or cut short, or above the limits of
///         CheckRgbaSize.
Result<RgbaImage> ReadPngImage(std::span<const std::uint8_t> bytes);

}  // namespace relocd
