#pragma once

#include <cstdint>
#include <string>

#include "can/can_frame.h"
#include "can/dbc.h"
#include "core/result.h"

namespace relocd {

/// How a message protects its bytes with an 8-bit checksum. Each is over the whole payload with the
/// checksum's own bits set to zero.
enum class ChecksumRule {
  kNone,
  kToyota,     ///< Sum of the size, the identifier's bytes and the payload's bytes.
  kXor8,       ///< Exclusive or of the payload's bytes.
  kCrc8J1850,  ///< CRC-8 SAE J1850: polynomial 0x1D, begun with 0xFF, inverted at the end.
};

/// `none`, `toyota`, `xor8` or `crc8_j1850`. @return kInvalidInput, naming these, for another name.
Result<ChecksumRule> ParseChecksumRule(const std::string& name);

/// The checksum that belongs into `signal`, which must be one of 8 bits that fits into the frame.
std::uint8_t Checksum(ChecksumRule rule, const CanFrame& frame, const DbcSignal& signal);

}  // namespace relocd
