#include "can/checksum.h"

#include <array>
#include <utility>

#include <fmt/format.h>

#include "can/signal.h"

namespace relocd {
namespace {

std::uint8_t ToyotaSum(const CanFrame& frame) {
  std::uint32_t sum = frame.size;
  for (std::uint32_t id = frame.id.value; id != 0; id >>= 8U)
    sum += id & 0xFFU;
  for (const std::uint8_t byte : frame.payload())
    sum += byte;
  return static_cast<std::uint8_t>(sum);
}

std::uint8_t Xor(const CanFrame& frame) {
  std::uint8_t result = 0;
  for (const std::uint8_t byte : frame.payload())
    result ^= byte;
  return result;
}

std::uint8_t Crc8J1850(const CanFrame& frame) {
  constexpr unsigned kPolynomial = 0x1D;
  unsigned crc = 0xFF;
  for (const std::uint8_t byte : frame.payload()) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc & 0x80U) != 0 ? crc << 1U ^ kPolynomial : crc << 1U;
  }
  return static_cast<std::uint8_t>(crc ^ 0xFFU);
}

}  // namespace

Result<ChecksumRule> ParseChecksumRule(const std::string& name) {
  constexpr std::array<std::pair<const char*, ChecksumRule>, 4> kRules = {{
      {"none", ChecksumRule::kNone},
      {"toyota", ChecksumRule::kToyota},
      {"xor8", ChecksumRule::kXor8},
      {"crc8_j1850", ChecksumRule::kCrc8J1850},
  }};
  for (const auto& [known, rule] : kRules) {
    if (name == known) return rule;
  }
  return Error{ErrorKind::kInvalidInput,
               fmt::format("is '{}', must be one of none, toyota, xor8, crc8_j1850", name)};
}

std::uint8_t Checksum(ChecksumRule rule, const CanFrame& frame, const DbcSignal& signal) {
  CanFrame blank = frame;
  EncodeBits(signal, 0, blank.payload());
  switch (rule) {
    case ChecksumRule::kToyota:
      return ToyotaSum(blank);
    case ChecksumRule::kXor8:
      return Xor(blank);
    case ChecksumRule::kCrc8J1850:
      return Crc8J1850(blank);
    case ChecksumRule::kNone:
      break;
  }
  return 0;
}

}  // namespace relocd
