#pragma once

#include <cstddef>
#include <cstdint>

namespace relocd {

/// Random numbers of the procedural campus: SplitMix64, with distributions of its own so that a
/// seed gives the same town with every standard library.
class CampusRandom {
 public:
  explicit CampusRandom(std::uint64_t seed) : state_(seed) {}

  std::uint64_t Bits() {
    state_ += 0x9E3779B97F4A7C15U;
    return Mix(state_);
  }

  /// A number in [0, 1).
  template <typename T = float>
  T Unit() {
    // 24 bits are exact in a float as well.
    return static_cast<T>(Bits() >> 40U) / static_cast<T>(1U << 24U);
  }

  template <typename T>
  T Uniform(T low, T high) {
    return low + (high - low) * Unit<T>();
  }

  /// A number in [0, count).
  std::size_t Index(std::size_t count) { return static_cast<std::size_t>((Bits() >> 32U) % count); }

  bool Chance(double probability) { return Unit<double>() < probability; }

  /// One of the elements of something with `size()` and `operator[]`.
  template <typename Choices>
  const auto& Pick(const Choices& choices) {
    return choices[Index(choices.size())];
  }

  /// Numbers of their own for one part of the town, so that a change of another part leaves it.
  [[nodiscard]] CampusRandom Fork(std::uint64_t part) const {
    return CampusRandom(Mix(state_ ^ Mix(part + 0x632BE59BD9B4E019U)));
  }

 private:
  static constexpr std::uint64_t Mix(std::uint64_t z) {
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31U);
  }

  std::uint64_t state_;
};

}  // namespace relocd
