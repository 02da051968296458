#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace relocd {

/// Walks over an encoded LCM message without allocating, and says whether it is what it claims to
/// be.
///
/// LCM 1.3.1's generated decode() trusts the lengths in a message: a negative or huge one throws,
/// or takes gigabytes. A walk with declared limits comes first, so that decode() sees only messages
/// that fit.
class WireWalker {
 public:
  explicit WireWalker(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  /// Numbers and fixed arrays.
  bool Skip(std::size_t size);

  /// An int32_t length in [0, limit] and that many bytes of payload (a `byte x[n]` right behind its
  /// `int32_t n`).
  bool Bytes(std::int32_t limit);

  /// A string of at most `limit` characters: length with the terminator, characters, terminator.
  bool String(std::int32_t limit);

  /// An int32_t count in [0, limit], then `element(*this)` that often.
  template <typename Element>
  bool Repeat(std::int32_t limit, Element&& element) {
    const std::int32_t count = ReadInt32();
    if (count < 0 || count > limit) return ok_ = false;
    for (std::int32_t i = 0; i < count && ok_; ++i)
      ok_ = element(*this) && ok_;
    return ok_;
  }

  /// Whether everything so far fitted, and nothing is left.
  [[nodiscard]] bool AtEnd() const { return ok_ && rest_.empty(); }

 private:
  /// -1 when there are not four bytes left.
  std::int32_t ReadInt32();

  std::span<const std::uint8_t> rest_;
  bool ok_ = true;
};

}  // namespace relocd
