#pragma once

#include <string>

#include "core/result.h"
#include "rendering/rgba_image.h"

namespace relocd {

/// Reads a file with a picture for a texture, PNG or SGI, whichever its first bytes say.
///
/// @return kUnavailable when it cannot be read; kInvalidInput for another format or a damaged
///         file. Errors name the file.
Result<RgbaImage> ReadRgbaImage(const std::string& path);

}  // namespace relocd
