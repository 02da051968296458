#pragma once

#include <cstdint>
#include <string>

#include "can/can_frame.h"
#include "can/dbc.h"
#include "core/result.h"

namespace relocd {

/// How a message protects its bytes with a checksum.
enum class ChecksumRule {
  kNone,
  kToyota,  ///< 8 bits: sum of the size, the identifier's bytes and the other bytes.
  kHonda,  ///< 4 bits: 8 less the sum of the half bytes of identifier and data, 3 more if extended.
  kXor8,   ///< 8 bits: exclusive or of the other bytes.
  kCrc8J1850,  ///< CRC-8 SAE J1850 (polynomial 0x1D, begun with 0xFF, inverted at the end) of all
               ///< bytes, the checksum's own as 0.
  kCrc8J1850Rest,  ///< The same of the bytes but the checksum's own.
  // AUTOSAR's E2E profile 1: the same CRC begun with 0 and not inverted, of a data identifier that
  // is not sent, and of the bytes but the checksum's own.
  kAutosarP1,             ///< Both bytes of the data identifier, the low one first.
  kAutosarP1Low,          ///< Its low byte.
  kAutosarP1Alternating,  ///< Its low byte with even counts, its high byte with odd ones.
  kAutosarP1Nibble,       ///< Its low byte, then 0; half of the high byte is in the data.
};

/// The names in configs, for messages: `none, toyota, ...`.
std::string ChecksumRuleNames();

/// @return kInvalidInput, naming what is allowed, for another name.
Result<ChecksumRule> ParseChecksumRule(const std::string& name);

/// Of the signal that holds a checksum by this rule.
int ChecksumBits(ChecksumRule rule);

/// What AUTOSAR's rules know besides the frame.
struct ChecksumContext {
  std::uint16_t data_id = 0;
  std::uint64_t count = 0;
};

/// The checksum that belongs into `signal`, which must be of ChecksumBits, on the borders of a byte
/// if it has 8, and fit into the frame.
std::uint8_t Checksum(ChecksumRule rule,
                      const CanFrame& frame,
                      const DbcSignal& signal,
                      const ChecksumContext& context = {});

}  // namespace relocd
