#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace relocd {

/// The number that the whole of `text` spells, blanks around it aside; nothing for anything else.
/// NaN and infinities are numbers here: the caller says what is allowed. Independent of the locale.
std::optional<double> ParseDouble(std::string_view text);

/// The decimal integer that the whole of `text` spells, blanks around it aside; nothing when it
/// overflows.
std::optional<std::int64_t> ParseInt64(std::string_view text);

/// `text` without blanks, tabs and line ends at its ends.
std::string_view Trim(std::string_view text);

}  // namespace relocd
