#include "core/index_range.h"

#include <algorithm>
#include <cstdint>
#include <optional>

#include <fmt/format.h>

#include "core/parse_number.h"

namespace relocd {
namespace {

std::optional<std::int64_t> ParseBound(std::string_view text, std::int64_t otherwise) {
  if (Trim(text).empty()) return otherwise;
  const auto bound = ParseInt64(text);
  return bound && *bound >= 0 ? bound : std::nullopt;
}

}  // namespace

Result<IndexRange> ParseIndexRange(std::string_view text, std::size_t count) {
  if (Trim(text).empty()) text = ":";
  const auto items = static_cast<std::int64_t>(count);
  const auto colon = text.find(':');
  const bool has_colon = colon != std::string_view::npos;
  const auto begin = has_colon ? ParseBound(text.substr(0, colon), 0) : std::nullopt;
  const auto end = has_colon ? ParseBound(text.substr(colon + 1), items) : std::nullopt;
  if (!begin || !end || *begin >= std::min(*end, items)) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("the range is '{}', must be 'A:B' with 0 <= A < B and A < {}", text, count)};
  }
  return IndexRange{static_cast<std::size_t>(*begin),
                    static_cast<std::size_t>(std::min(*end, items))};
}

}  // namespace relocd
