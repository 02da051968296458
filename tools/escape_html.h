#pragma once

#include <string>
#include <string_view>

namespace relocd {

/// Text as it may stand in HTML, in attributes too.
std::string EscapeHtml(std::string_view text);

}  // namespace relocd
