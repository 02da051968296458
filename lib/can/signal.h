#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "can/can_frame.h"
#include "can/dbc.h"
#include "core/result.h"

namespace relocd {

/// The raw value as VAL_ names it: sign-extended if the signal is signed.
std::int64_t RawInteger(const DbcSignal& signal, std::uint64_t bits);

/// Whether every bit of the signal lies within `size` bytes.
bool SignalFits(const DbcSignal& signal, std::size_t size);

/// The signal's bits, the most significant first, in the low bits of the result: what a counter
/// counts, and a checksum is. Nothing when the payload is too short.
std::optional<std::uint64_t> DecodeBits(const DbcSignal& signal,
                                        std::span<const std::uint8_t> payload);

/// The physical value: raw * factor + offset. Nothing when the payload is too short, or the raw
/// value is a floating-point number that is not finite.
std::optional<double> DecodeSignal(const DbcSignal& signal, std::span<const std::uint8_t> payload);

/// The same in the digits of long double, which holds integers of 64 bits on the processors that we
/// build for, and NaN or infinite where that is what the frame says. Nothing when the payload is
/// too short.
std::optional<long double> DecodeExactly(const DbcSignal& signal,
                                         std::span<const std::uint8_t> payload);

/// The value as a person writes it: with the decimals that factor and offset give an integer, 0.3
/// and not 0.30000000000000004, and else the fewest digits that give the same number.
std::string FormatValue(const DbcSignal& signal, long double value);

/// Whether a frame of `message` with this payload has the signal, which its multiplexors decide.
bool IsPresent(const DbcMessage& message,
               const DbcSignal& signal,
               std::span<const std::uint8_t> payload);

/// Writes the low bits of `bits`; the payload must be long enough. The frame's other bits stay.
void EncodeBits(const DbcSignal& signal, std::uint64_t bits, std::span<std::uint8_t> payload);

/// Writes the raw value nearest to a physical one.
///
/// @return kInvalidInput, naming signal, value and the range, when the signal cannot hold it.
Result<void> EncodeSignal(const DbcSignal& signal, double value, std::span<std::uint8_t> payload);

}  // namespace relocd
