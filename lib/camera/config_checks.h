#pragma once

#include <string>
#include <string_view>

#include <fmt/format.h>

#include "core/result.h"

namespace relocd {

template <typename Number>
Result<void> CheckRange(std::string_view field, Number value, Number low, Number high) {
  if (value >= low && value <= high) return {};  // false for NaN
  return Error{ErrorKind::kInvalidInput,
               fmt::format("{} is {}, must be in [{}, {}]", field, value, low, high)};
}

template <typename... Names>
Result<void> CheckOneOf(std::string_view field, const std::string& value, Names... names) {
  if (((value == names) || ...)) return {};
  std::string allowed;
  ((allowed += allowed.empty() ? names : std::string(", ") + names), ...);
  return Error{ErrorKind::kInvalidInput,
               fmt::format("{} is '{}', must be one of {}", field, value, allowed)};
}

}  // namespace relocd
