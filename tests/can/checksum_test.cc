#include "can/checksum.h"

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

TEST(ChecksumTest, DoesNotDependOnItsOwnBits) {
  for (const ChecksumRule rule :
       {ChecksumRule::kToyota, ChecksumRule::kXor8, ChecksumRule::kCrc8J1850}) {
    EXPECT_EQ(Checksum(rule, Frame(0x123, {1, 2, 3, 0}), LastByte(4)),
              Checksum(rule, Frame(0x123, {1, 2, 3, 0xFF}), LastByte(4)));
  }
}

TEST(ParseChecksumRuleTest, NamesWhatIsAllowed) {
  const auto rule = ParseChecksumRule("toyota");
  ASSERT_TRUE(rule);
  EXPECT_EQ(*rule, ChecksumRule::kToyota);
  EXPECT_EQ(ParseChecksumRule("sum").error().message,
            "is 'sum', must be one of none, toyota, xor8, crc8_j1850");
}

}  // namespace
}  // namespace relocd
