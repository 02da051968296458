#pragma once

#include <cstdint>

namespace relocd {

/// Random numbers that are a function of (seed, counter), and so the same on every machine and in
/// whichever order they are asked for: the output function of G. Steele, D. Lea and C. Flood,
/// "Fast Splittable Pseudorandom Number Generators" (SplitMix), OOPSLA 2014. Thread-safe.
class CounterRandom {
 public:
  explicit CounterRandom(std::uint64_t seed) : seed_(Mix(seed)) {}

  [[nodiscard]] std::uint64_t Bits(std::uint64_t counter) const {
    return Mix(seed_ + (counter + 1) * 0x9E3779B97F4A7C15u);
  }

  /// Evenly spread over [0, 1).
  [[nodiscard]] float Unit(std::uint64_t counter) const {
    constexpr int kMantissaBits = 24;
    constexpr float kUlp = 1.0F / static_cast<float>(1U << kMantissaBits);
    return static_cast<float>(Bits(counter) >> (64 - kMantissaBits)) * kUlp;
  }

  /// A number in [0, bound) from 32 random bits. Its bias, bound / 2^32, is nothing for bounds of
  /// some thousands.
  static std::uint32_t Below(std::uint32_t bound, std::uint32_t bits) {
    return static_cast<std::uint32_t>((std::uint64_t{bits} * bound) >> 32);
  }

 private:
  static constexpr std::uint64_t Mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }

  std::uint64_t seed_;
};

}  // namespace relocd
