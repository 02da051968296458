#include "can/checksum.h"

#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "can/signal.h"

namespace relocd {
namespace {

constexpr std::array<std::pair<const char*, ChecksumRule>, 10> kRules = {{
    {"none", ChecksumRule::kNone},
    {"toyota", ChecksumRule::kToyota},
    {"honda", ChecksumRule::kHonda},
    {"xor8", ChecksumRule::kXor8},
    {"crc8_j1850", ChecksumRule::kCrc8J1850},
    {"crc8_j1850_rest", ChecksumRule::kCrc8J1850Rest},
    {"autosar_p1", ChecksumRule::kAutosarP1},
    {"autosar_p1_low", ChecksumRule::kAutosarP1Low},
    {"autosar_p1_alternating", ChecksumRule::kAutosarP1Alternating},
    {"autosar_p1_nibble", ChecksumRule::kAutosarP1Nibble},
}};

std::uint8_t ToyotaSum(const CanFrame& frame) {
  std::uint32_t sum = frame.size;
  for (std::uint32_t id = frame.id.value; id != 0; id >>= 8U)
    sum += id & 0xFFU;
  for (const std::uint8_t byte : frame.payload())
    sum += byte;
  return static_cast<std::uint8_t>(sum);
}

std::uint8_t HondaSum(const CanFrame& frame) {
  std::uint32_t sum = 0;
  for (std::uint32_t id = frame.id.value; id != 0; id >>= 4U)
    sum += id & 0xFU;
  for (const unsigned byte : frame.payload())
    sum += (byte & 0xFU) + (byte >> 4U);
  return static_cast<std::uint8_t>((8U - sum + (frame.id.value > kCanStandardMask ? 3U : 0U)) &
                                   0xFU);
}

std::uint8_t Xor(const CanFrame& frame) {
  std::uint8_t result = 0;
  for (const std::uint8_t byte : frame.payload())
    result ^= byte;
  return result;
}

/// The register of the CRC with SAE J1850's polynomial after some more bytes.
std::uint8_t AdvanceCrc(std::uint8_t crc, std::span<const std::uint8_t> bytes) {
  constexpr unsigned kPolynomial = 0x1D;
  unsigned value = crc;
  for (const std::uint8_t byte : bytes) {
    value ^= byte;
    for (int bit = 0; bit < 8; ++bit)
      value = ((value & 0x80U) != 0 ? value << 1U ^ kPolynomial : value << 1U) & 0xFFU;
  }
  return static_cast<std::uint8_t>(value);
}

/// The same, of the bytes that are not the checksum's own.
std::uint8_t AdvanceCrcOverRest(std::uint8_t crc, const CanFrame& frame, const DbcSignal& signal) {
  const auto own = static_cast<std::size_t>(signal.start_bit / 8);
  return AdvanceCrc(AdvanceCrc(crc, frame.payload().first(own)), frame.payload().subspan(own + 1));
}

std::uint8_t AutosarCrc(ChecksumRule rule,
                        const CanFrame& frame,
                        const DbcSignal& signal,
                        const ChecksumContext& context) {
  const std::array<std::uint8_t, 2> id = {static_cast<std::uint8_t>(context.data_id & 0xFFU),
                                          static_cast<std::uint8_t>(context.data_id >> 8U)};
  const std::span<const std::uint8_t> bytes(id);
  std::uint8_t crc = 0;
  if (rule == ChecksumRule::kAutosarP1) {
    crc = AdvanceCrc(0, bytes);
  } else if (rule == ChecksumRule::kAutosarP1Alternating) {
    crc = AdvanceCrc(0, bytes.subspan(context.count % 2, 1));
  } else {
    crc = AdvanceCrc(0, bytes.first(1));
    if (rule == ChecksumRule::kAutosarP1Nibble)
      crc = AdvanceCrc(crc, std::array<std::uint8_t, 1>{0});
  }
  return AdvanceCrcOverRest(crc, frame, signal);
}

}  // namespace

std::string ChecksumRuleNames() {
  std::string names;
  for (const auto& [name, rule] : kRules)
    names += (names.empty() ? "" : ", ") + std::string(name);
  return names;
}

Result<ChecksumRule> ParseChecksumRule(const std::string& name) {
  for (const auto& [known, rule] : kRules) {
    if (name == known) return rule;
  }
  return Error{ErrorKind::kInvalidInput,
               fmt::format("is '{}', must be one of {}", name, ChecksumRuleNames())};
}

int ChecksumBits(ChecksumRule rule) {
  return rule == ChecksumRule::kHonda ? 4 : 8;
}

std::uint8_t Checksum(ChecksumRule rule,
                      const CanFrame& frame,
                      const DbcSignal& signal,
                      const ChecksumContext& context) {
  CanFrame blank = frame;
  EncodeBits(signal, 0, blank.payload());
  switch (rule) {
    case ChecksumRule::kToyota:
      return ToyotaSum(blank);
    case ChecksumRule::kHonda:
      return HondaSum(blank);
    case ChecksumRule::kXor8:
      return Xor(blank);
    case ChecksumRule::kCrc8J1850:
      return AdvanceCrc(0xFF, blank.payload()) ^ 0xFFU;
    case ChecksumRule::kCrc8J1850Rest:
      return AdvanceCrcOverRest(0xFF, blank, signal) ^ 0xFFU;
    case ChecksumRule::kAutosarP1:
    case ChecksumRule::kAutosarP1Low:
    case ChecksumRule::kAutosarP1Alternating:
    case ChecksumRule::kAutosarP1Nibble:
      return AutosarCrc(rule, blank, signal, context);
    case ChecksumRule::kNone:
      break;
  }
  return 0;
}

}  // namespace relocd
