#pragma once

#include <string>
#include <string_view>

#include "core/progress.h"

namespace relocd {

/// The SHA-256 of `bytes` as 64 lower-case hex digits.
std::string Sha256Hex(std::string_view bytes, const Progress& progress = Unwatched);

}  // namespace relocd
