#pragma once

#include <string>

#include "camera/measured_depth.h"
#include "core/result.h"

namespace relocd {

/// Reads a depth image: a PNG of one channel of 16 bits, millimetres, 0 where nothing is known.
///
/// @return kUnavailable when the file cannot be read; kInvalidInput when it is something else, or
///         is not of the size.
Result<MeasuredDepth> ReadDepthFile(const std::string& path, int width, int height);

/// Writes one. @return kUnavailable when that fails.
Result<void> WriteDepthFile(const std::string& path, const MeasuredDepth& depth);

}  // namespace relocd
