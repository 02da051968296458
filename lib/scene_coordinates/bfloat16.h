#pragma once

#include <bit>
#include <cstdint>

namespace relocd {

/// A float of 8 bits of precision and the full range: its upper half.
struct Bfloat16 {
  std::uint16_t bits = 0;
};

/// To the nearest, ties to even. NaN is not kept as NaN: none comes here.
inline Bfloat16 ToBfloat16(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return {static_cast<std::uint16_t>((bits + 0x7FFFU + ((bits >> 16U) & 1U)) >> 16U)};
}

inline float ToFloat(Bfloat16 value) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(value.bits) << 16U);
}
inline float ToFloat(float value) {
  return value;
}

}  // namespace relocd
