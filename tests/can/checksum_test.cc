#include "can/checksum.h"

#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace relocd {
namespace {

CanFrame Frame(std::uint32_t id, const std::vector<std::uint8_t>& bytes) {
  CanFrame frame;
  frame.id.value = id;
  frame.SetPayload(bytes);
  return frame;
}

DbcSignal LastByte(int size) {
  return {.name = "CHECKSUM", .start_bit = 8 * (size - 1), .length = 8};
}

TEST(ChecksumTest, AgreesWithARecordedToyotaFrame) {
  // (46408.584954) can0 0B4#000000001D0B7A5E
  const CanFrame frame = Frame(0xB4, {0, 0, 0, 0, 0x1D, 0x0B, 0x7A, 0x5E});
  EXPECT_EQ(Checksum(ChecksumRule::kToyota, frame, LastByte(8)), 0x5E);
}

TEST(ChecksumTest, AgreesWithPublishedValuesOfCrc8J1850) {
  // AUTOSAR's specification of CRC routines lists 00 00 00 00 -> 59. The checksum's own byte counts
  // as zero.
  const CanFrame zeros = Frame(0, {0x00, 0x00, 0x00, 0xAB});
  EXPECT_EQ(Checksum(ChecksumRule::kCrc8J1850, zeros, LastByte(4)), 0x59);
}

TEST(ChecksumTest, XorsThePayload) {
  EXPECT_EQ(Checksum(ChecksumRule::kXor8, Frame(0x7, {0x0F, 0xF0, 0x11, 0x77}), LastByte(4)), 0xEE);
}

/// AUTOSAR's specification of CRC routines, table "CRC-8 SAE J1850": data and result. The
/// checksum's byte is put behind the data.
TEST(ChecksumTest, AgreesWithPublishedValuesOverTheOtherBytes) {
  const std::vector<std::pair<std::vector<std::uint8_t>, int>> cases = {
      {{0x00, 0x00, 0x00, 0x00}, 0x59},
      {{0xF2, 0x01, 0x83}, 0x37},
      {{0x0F, 0xAA, 0x00, 0x55}, 0x79},
      {{0x00, 0xFF, 0x55, 0x11}, 0xB8},
      {{0x33, 0x22, 0x55, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF}, 0xCB},
      {{0x92, 0x6B, 0x55}, 0x8C},
      {{0xFF, 0xFF, 0xFF, 0xFF}, 0x74},
      {{'1', '2', '3', '4', '5', '6', '7', '8', '9'}, 0x4B},
  };
  for (const auto& [data, expected] : cases) {
    std::vector<std::uint8_t> bytes = data;
    bytes.push_back(0xAB);
    const DbcSignal last = LastByte(static_cast<int>(bytes.size()));
    EXPECT_EQ(Checksum(ChecksumRule::kCrc8J1850Rest, Frame(0, bytes), last), expected);
  }
}

/// The examples of AUTOSAR's E2E protocol specification: 8 bytes, the CRC in the first one, the
/// counter in the second one, data identifier 0x123.
TEST(ChecksumTest, AgreesWithPublishedValuesOfAutosarsProfile1) {
  const DbcSignal first{.name = "CRC", .start_bit = 0, .length = 8};
  const auto check = [&](ChecksumRule rule, std::uint8_t second, std::uint64_t count) {
    const CanFrame frame = Frame(0, {0xAB, second, 0, 0, 0, 0, 0, 0});
    return Checksum(rule, frame, first, {.data_id = 0x123, .count = count});
  };
  EXPECT_EQ(check(ChecksumRule::kAutosarP1, 0x00, 0), 0xCC);
  EXPECT_EQ(check(ChecksumRule::kAutosarP1, 0x01, 1), 0x91);
  EXPECT_EQ(check(ChecksumRule::kAutosarP1Nibble, 0x10, 0), 0x2A);
  EXPECT_EQ(check(ChecksumRule::kAutosarP1Nibble, 0x11, 1), 0x77);
  EXPECT_EQ(check(ChecksumRule::kAutosarP1Low, 0x00, 0), 0xCE);
  EXPECT_EQ(check(ChecksumRule::kAutosarP1Alternating, 0x00, 0), 0xCE);
  EXPECT_NE(check(ChecksumRule::kAutosarP1Alternating, 0x00, 1), 0xCE);
}

/// Frames of a real Honda: the low half of the last byte.
TEST(ChecksumTest, AgreesWithRecordedHondaFrames) {
  const auto low_half = [](int size) {
    return DbcSignal{.name = "CHECKSUM", .start_bit = 8 * (size - 1), .length = 4};
  };
  EXPECT_EQ(Checksum(ChecksumRule::kHonda, Frame(0x1DC, {0x02, 0x02, 0xCB, 0x12}), low_half(4)),
            0x2);
  EXPECT_EQ(Checksum(ChecksumRule::kHonda,
                     Frame(0x324, {0x7D, 0x65, 0x14, 0x6F, 0x00, 0x00, 0x00, 0x15}),
                     low_half(8)),
            0x5);
  // An identifier of 29 bits adds 3, and its own half bytes: 8 - 1 - 1 + 3.
  CanFrame extended = Frame(0x10000, {0x01, 0x00});
  extended.id.extended = true;
  EXPECT_EQ(Checksum(ChecksumRule::kHonda, extended, low_half(2)), 0x9);
}

TEST(ChecksumTest, DoesNotDependOnItsOwnBits) {
  for (const ChecksumRule rule : {ChecksumRule::kToyota,
                                  ChecksumRule::kXor8,
                                  ChecksumRule::kCrc8J1850,
                                  ChecksumRule::kCrc8J1850Rest,
                                  ChecksumRule::kAutosarP1}) {
    EXPECT_EQ(Checksum(rule, Frame(0x123, {1, 2, 3, 0}), LastByte(4)),
              Checksum(rule, Frame(0x123, {1, 2, 3, 0xFF}), LastByte(4)));
  }
}

TEST(ParseChecksumRuleTest, NamesWhatIsAllowed) {
  const auto rule = ParseChecksumRule("toyota");
  ASSERT_TRUE(rule);
  EXPECT_EQ(*rule, ChecksumRule::kToyota);
  EXPECT_EQ(ParseChecksumRule("sum").error().message,
            "is 'sum', must be one of none, toyota, honda, xor8, crc8_j1850, crc8_j1850_rest, "
            "autosar_p1, "
            "autosar_p1_low, autosar_p1_alternating, autosar_p1_nibble");
}

}  // namespace
}  // namespace relocd
