#pragma once

#include <cstddef>
#include <string_view>

#include "core/result.h"

namespace relocd {

/// The indices in [begin, end), of frames or rows counted from 0.
struct IndexRange {
  std::size_t begin = 0;
  std::size_t end = 0;

  [[nodiscard]] bool Contains(std::size_t index) const { return index >= begin && index < end; }
  [[nodiscard]] std::size_t size() const { return end - begin; }

  friend bool operator==(const IndexRange&, const IndexRange&) = default;
};

/// The range that `A:B` means among `count` items: A is the first, B the one behind the last.
/// Either may be left out, and an empty text means all. B may be above `count`, and ends there.
///
/// @return kInvalidInput for another form, and for a range without an item.
Result<IndexRange> ParseIndexRange(std::string_view text, std::size_t count);

}  // namespace relocd
