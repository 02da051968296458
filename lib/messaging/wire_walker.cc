#include "messaging/wire_walker.h"

#include <cstring>

namespace relocd {

bool WireWalker::Skip(std::size_t size) {
  if (!ok_ || rest_.size() < size) return ok_ = false;
  rest_ = rest_.subspan(size);
  return true;
}

std::int32_t WireWalker::ReadInt32() {
  if (!ok_ || rest_.size() < sizeof(std::int32_t)) {
    ok_ = false;
    return -1;
  }
  const std::uint32_t value = std::uint32_t{rest_[0]} << 24 | std::uint32_t{rest_[1]} << 16 |
                              std::uint32_t{rest_[2]} << 8 | std::uint32_t{rest_[3]};
  rest_ = rest_.subspan(sizeof(std::int32_t));
  return static_cast<std::int32_t>(value);
}

bool WireWalker::Bytes(std::int32_t limit) {
  const std::int32_t size = ReadInt32();
  if (size < 0 || size > limit) return ok_ = false;
  return Skip(static_cast<std::size_t>(size));
}

bool WireWalker::String(std::int32_t limit) {
  const std::int32_t size = ReadInt32();  // with the terminator, so never 0
  if (size < 1 || size > limit + 1) return ok_ = false;
  const std::size_t characters = static_cast<std::size_t>(size) - 1;
  if (rest_.size() <= characters) return ok_ = false;
  const void* terminator = std::memchr(rest_.data(), 0, characters + 1);
  if (terminator != rest_.data() + characters) return ok_ = false;
  return Skip(characters + 1);
}

}  // namespace relocd
