#pragma once

#include <cstdint>

namespace relocd {

/// How far a free-running counter of `bits` bits (1 to 63) went from `before` to `after`: the
/// shorter way round its wrap, negative for backwards. Right as long as it moved less than half its
/// range.
std::int64_t TickDifference(std::uint64_t before, std::uint64_t after, int bits);

/// How far such a counter can go before the shorter way round is the wrong one.
std::int64_t MaxTickDifference(int bits);

}  // namespace relocd
