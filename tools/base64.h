#pragma once

#include <string>
#include <string_view>

namespace relocd {

/// RFC 4648, with padding.
std::string EncodeBase64(std::string_view bytes);

}  // namespace relocd
