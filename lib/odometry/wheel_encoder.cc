#include "odometry/wheel_encoder.h"

#include "core/check.h"

namespace relocd {

std::int64_t TickDifference(std::uint64_t before, std::uint64_t after, int bits) {
  RELOCD_CHECK(bits >= 1 && bits <= 63, "counter width");
  // In the topmost bits, where the wrap is that of the integer, and the sign is its own.
  const auto shift = static_cast<unsigned>(64 - bits);
  return static_cast<std::int64_t>((after - before) << shift) >> shift;
}

std::int64_t MaxTickDifference(int bits) {
  RELOCD_CHECK(bits >= 1 && bits <= 63, "counter width");
  return (std::int64_t{1} << static_cast<unsigned>(bits - 1)) - 1;
}

}  // namespace relocd
