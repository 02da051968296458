#include "can/signal.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <system_error>

#include <fmt/format.h>

#include "core/check.h"
#include "core/parse_number.h"

namespace relocd {
namespace {

/// Where in the frame the signal's n-th bit is, counted from its most significant one.
int BitPosition(const DbcSignal& signal, int n) {
  if (signal.byte_order == ByteOrder::kLittleEndian) {
    return signal.start_bit + signal.length - 1 - n;
  }
  // Big endian goes down within a byte, and on at bit 7 of the next. In "sawtooth" numbering,
  // which counts bits in the order of transmission, that is one up.
  const int sawtooth = (signal.start_bit / 8) * 8 + (7 - signal.start_bit % 8) + n;
  return (sawtooth / 8) * 8 + (7 - sawtooth % 8);
}

std::uint64_t LowBits(int length) {
  return length >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << length) - 1;
}

std::int64_t SignExtend(std::uint64_t bits, int length) {
  const int shift = 64 - length;
  return static_cast<std::int64_t>(bits << shift) >> shift;
}

template <typename Float>
Float RawValue(const DbcSignal& signal, std::uint64_t bits) {
  switch (signal.type) {
    case RawType::kUnsigned:
      return static_cast<Float>(bits);
    case RawType::kSigned:
      return static_cast<Float>(SignExtend(bits, signal.length));
    case RawType::kFloat:
      return static_cast<Float>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
    case RawType::kDouble:
      return static_cast<Float>(std::bit_cast<double>(bits));
  }
  return std::numeric_limits<Float>::quiet_NaN();
}

template <typename Float>
std::optional<Float> PhysicalValue(const DbcSignal& signal, std::span<const std::uint8_t> payload) {
  const auto bits = DecodeBits(signal, payload);
  if (!bits) return std::nullopt;
  return RawValue<Float>(signal, *bits) * static_cast<Float>(signal.factor) +
         static_cast<Float>(signal.offset);
}

/// Digits behind the point: 2 of 0.25, 7 of 1.5e-06.
int Decimals(double number) {
  const std::string text = fmt::format("{}", number);
  const std::size_t mantissa_end = std::min(text.find('e'), text.size());
  const std::size_t point = std::min(text.find('.'), mantissa_end);
  const int fraction = point == mantissa_end ? 0 : static_cast<int>(mantissa_end - point) - 1;
  const int exponent =
      mantissa_end == text.size()
          ? 0
          : static_cast<int>(ParseInt64(text.substr(mantissa_end + 1)).value_or(0));
  return std::max(fraction - exponent, 0);
}

/// The bits of the integer nearest to `raw`; nothing outside of the signal's range.
std::optional<std::uint64_t> IntegerBits(const DbcSignal& signal, double raw) {
  const bool is_signed = signal.type == RawType::kSigned;
  const double rounded = std::nearbyint(raw);
  const double end = std::ldexp(1.0, is_signed ? signal.length - 1 : signal.length);
  const double begin = is_signed ? -end : 0.0;
  if (!(rounded >= begin && rounded < end)) return std::nullopt;
  if (is_signed) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(rounded)) & LowBits(signal.length);
  }
  return static_cast<std::uint64_t>(rounded);
}

std::optional<std::uint64_t> RawBits(const DbcSignal& signal, double raw) {
  if (!std::isfinite(raw)) return std::nullopt;
  if (signal.type == RawType::kFloat) {
    if (std::abs(raw) > static_cast<double>(std::numeric_limits<float>::max())) return std::nullopt;
    return std::bit_cast<std::uint32_t>(static_cast<float>(raw));
  }
  if (signal.type == RawType::kDouble) return std::bit_cast<std::uint64_t>(raw);
  return IntegerBits(signal, raw);
}

}  // namespace

std::int64_t RawInteger(const DbcSignal& signal, std::uint64_t bits) {
  return signal.type == RawType::kSigned ? SignExtend(bits, signal.length)
                                         : static_cast<std::int64_t>(bits);
}

bool SignalFits(const DbcSignal& signal, std::size_t size) {
  if (signal.length < 1 || signal.start_bit < 0) return false;
  // The last bit in the order of transmission lies in the highest byte.
  const int last = signal.byte_order == ByteOrder::kLittleEndian
                       ? signal.start_bit + signal.length - 1
                       : BitPosition(signal, signal.length - 1);
  return static_cast<std::size_t>(last / 8) < size;
}

std::optional<std::uint64_t> DecodeBits(const DbcSignal& signal,
                                        std::span<const std::uint8_t> payload) {
  if (!SignalFits(signal, payload.size())) return std::nullopt;
  std::uint64_t bits = 0;
  for (int n = 0; n < signal.length; ++n) {
    const int position = BitPosition(signal, n);
    const unsigned byte = payload[static_cast<std::size_t>(position / 8)];
    bits = bits << 1U | (byte >> static_cast<unsigned>(position % 8) & 1U);
  }
  return bits;
}

std::optional<double> DecodeSignal(const DbcSignal& signal, std::span<const std::uint8_t> payload) {
  const auto value = PhysicalValue<double>(signal, payload);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<long double> DecodeExactly(const DbcSignal& signal,
                                         std::span<const std::uint8_t> payload) {
  return PhysicalValue<long double>(signal, payload);
}

std::string FormatValue(const DbcSignal& signal, long double value) {
  if (signal.type == RawType::kFloat && signal.factor == 1.0 && signal.offset == 0.0) {
    return fmt::format("{}", static_cast<float>(value));
  }
  const int decimals = std::max(Decimals(signal.factor), Decimals(signal.offset));
  // Above it the error of a factor such as 0.1, which no double holds, shows in the last decimal.
  const long double limit = decimals == 0 ? 0x1p64L : 4e15L;
  const long double scale = std::pow(10.0L, decimals);
  if (signal.is_integer() && decimals < 18 && std::abs(value) * scale < limit) {
    // Adding 0 turns -0 into 0.
    const long double rounded = std::rint(value * scale) / scale + 0.0L;
    std::array<char, 64> buffer{};  // not fmt, which has no such precision for small long doubles
    const auto [end, error] = std::to_chars(
        buffer.data(), buffer.data() + buffer.size(), rounded, std::chars_format::fixed, decimals);
    RELOCD_CHECK(error == std::errc(), "a number of 20 digits fits");
    std::string text(buffer.data(), end);
    if (decimals > 0) text.erase(text.find_last_not_of('0') + 1);
    if (text.ends_with('.')) text.pop_back();
    return text;
  }
  return fmt::format("{}", static_cast<double>(value));
}

bool IsPresent(const DbcMessage& message,
               const DbcSignal& signal,
               std::span<const std::uint8_t> payload) {
  // DbcFile has seen that the way up ends.
  const DbcSignal* below = &signal;
  while (!below->mux_ranges.empty()) {
    const DbcSignal* const multiplexor = message.FindSignal(below->multiplexor);
    if (multiplexor == nullptr) return false;
    const auto value = DecodeBits(*multiplexor, payload);
    const auto selects = [&](const MuxRange& range) { return value && range.Contains(*value); };
    if (std::none_of(below->mux_ranges.begin(), below->mux_ranges.end(), selects)) return false;
    below = multiplexor;
  }
  return true;
}

void EncodeBits(const DbcSignal& signal, std::uint64_t bits, std::span<std::uint8_t> payload) {
  RELOCD_CHECK(SignalFits(signal, payload.size()), "signal does not fit into the payload");
  for (int n = signal.length - 1; n >= 0; --n, bits >>= 1U) {
    const int position = BitPosition(signal, n);
    std::uint8_t& byte = payload[static_cast<std::size_t>(position / 8)];
    const unsigned mask = 1U << static_cast<unsigned>(position % 8);
    byte = static_cast<std::uint8_t>((bits & 1U) != 0 ? byte | mask : byte & ~mask);
  }
}

Result<void> EncodeSignal(const DbcSignal& signal, double value, std::span<std::uint8_t> payload) {
  const auto bits = RawBits(signal, (value - signal.offset) / signal.factor);
  if (!bits) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("signal {} cannot hold {}, must be within {} bits at {} each and {}",
                             signal.name,
                             value,
                             signal.length,
                             signal.factor,
                             signal.offset)};
  }
  EncodeBits(signal, *bits, payload);
  return {};
}

}  // namespace relocd
