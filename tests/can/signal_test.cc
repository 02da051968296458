#include "can/signal.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using testing::ElementsAre;

struct DecodeCase {
  std::string name;
  DbcSignal signal;
  std::vector<std::uint8_t> payload;
  double expected;
};

class DecodeSignalTest : public testing::TestWithParam<DecodeCase> {};

TEST_P(DecodeSignalTest, GivesTheValueComputedByHand) {
  const auto value = DecodeSignal(GetParam().signal, GetParam().payload);
  ASSERT_TRUE(value);
  EXPECT_DOUBLE_EQ(*value, GetParam().expected);
}

TEST_P(DecodeSignalTest, IsEncodedBackToTheSameBytes) {
  std::vector<std::uint8_t> payload(GetParam().payload.size());
  ASSERT_TRUE(EncodeSignal(GetParam().signal, GetParam().expected, payload));
  EXPECT_EQ(DecodeBits(GetParam().signal, payload),
            DecodeBits(GetParam().signal, GetParam().payload));
}

constexpr ByteOrder kLittle = ByteOrder::kLittleEndian;
constexpr ByteOrder kBig = ByteOrder::kBigEndian;

INSTANTIATE_TEST_SUITE_P(
    Signals,
    DecodeSignalTest,
    testing::ValuesIn(std::vector<DecodeCase>{
        {"OneBit", {.start_bit = 3, .length = 1}, {0x08}, 1.0},
        {"LittleEndianWord", {.start_bit = 0, .length = 16}, {0x34, 0x12}, 0x1234},
        {"LittleEndianAcrossBytes", {.start_bit = 4, .length = 12}, {0xA0, 0xBC}, 0xBCA},
        {"BigEndianWord", {.start_bit = 7, .length = 16, .byte_order = kBig}, {0x12, 0x34}, 0x1234},
        {"BigEndianAcrossBytes",
         {.start_bit = 3, .length = 12, .byte_order = kBig},
         {0xFA, 0xBC},
         0xABC},
        {"SignedMinusOne", {.start_bit = 0, .length = 8, .type = RawType::kSigned}, {0xFF}, -1.0},
        {"SignedMostNegative",
         {.start_bit = 7, .length = 12, .byte_order = kBig, .type = RawType::kSigned},
         {0x80, 0x00},
         -2048.0},
        {"FactorAndOffset",
         {.start_bit = 0, .length = 8, .factor = 0.5, .offset = -10.0},
         {30},
         5.0},
        // 0x20 is 32 km/h of 0.01 at an offset: WHEEL_SPEEDS.FR of a Toyota that stands.
        {"ToyotaStanding",
         {.start_bit = 6, .length = 15, .byte_order = kBig, .factor = 0.01, .offset = -67.67},
         {0x1A, 0x6F},
         0.01 * 0x1A6F - 67.67},
        {"Float",
         {.start_bit = 0, .length = 32, .type = RawType::kFloat},
         {0x00, 0x00, 0xC0, 0x3F},
         1.5},
        {"BigEndianDouble",
         {.start_bit = 7, .length = 64, .byte_order = kBig, .type = RawType::kDouble},
         {0xC0, 0x04, 0, 0, 0, 0, 0, 0},
         -2.5},
        // 64 bits: what a double cannot tell apart is rounded, and no shift goes too far.
        {"AllOf64Bits", {.start_bit = 0, .length = 64}, std::vector<std::uint8_t>(8, 0), 0.0},
        {"HighestOf64Bits",
         {.start_bit = 0, .length = 64},
         {0, 0, 0, 0, 0, 0, 0, 0x80},
         9223372036854775808.0},
        {"BigEndian64Bits",
         {.start_bit = 7, .length = 64, .byte_order = kBig},
         {0x80, 0, 0, 0, 0, 0, 0, 0},
         9223372036854775808.0},
        {"MostNegativeOf64Bits",
         {.start_bit = 0, .length = 64, .type = RawType::kSigned},
         {0, 0, 0, 0, 0, 0, 0, 0x80},
         -9223372036854775808.0},
        {"MinusOneOf64Bits",
         {.start_bit = 7, .length = 64, .byte_order = kBig, .type = RawType::kSigned},
         std::vector<std::uint8_t>(8, 0xFF),
         -1.0},
        {"MostNegativeOf63Bits",
         {.start_bit = 1, .length = 63, .type = RawType::kSigned},
         {0, 0, 0, 0, 0, 0, 0, 0x80},
         -4611686018427387904.0},
    }),
    [](const auto& instance) { return instance.param.name; });

TEST(DecodeSignalTest, RoundsTheLargestOf64Bits) {
  const std::vector<std::uint8_t> ones(8, 0xFF);
  EXPECT_EQ(DecodeSignal({.start_bit = 0, .length = 64}, ones), 18446744073709551616.0);
  EXPECT_EQ(DecodeBits({.start_bit = 0, .length = 64}, ones), ~std::uint64_t{0});
  const std::vector<std::uint8_t> most{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F};
  EXPECT_EQ(DecodeSignal({.start_bit = 0, .length = 64, .type = RawType::kSigned}, most),
            9223372036854775808.0);
}

TEST(DecodeSignalTest, HasNothingOfAShortPayload) {
  const std::vector<std::uint8_t> payload(3);
  EXPECT_TRUE(DecodeSignal({.start_bit = 8, .length = 16}, payload));
  EXPECT_FALSE(DecodeSignal({.start_bit = 9, .length = 16}, payload));
  EXPECT_FALSE(DecodeSignal({.start_bit = 15, .length = 17, .byte_order = kBig}, payload));
}

TEST(DecodeSignalTest, HasNothingOfAFloatThatIsNotFinite) {
  const std::vector<std::uint8_t> payload = {0x00, 0x00, 0xC0, 0x7F};
  EXPECT_FALSE(DecodeSignal({.start_bit = 0, .length = 32, .type = RawType::kFloat}, payload));
}

/// Any signal that fits into 64 bytes.
DbcSignal RandomSignal(std::mt19937& engine) {
  DbcSignal signal;
  signal.byte_order = engine() % 2 == 0 ? kLittle : kBig;
  signal.type = engine() % 2 == 0 ? RawType::kUnsigned : RawType::kSigned;
  do {
    signal.start_bit = static_cast<int>(engine() % 512);
    signal.length = static_cast<int>(engine() % 64) + 1;
  } while (!SignalFits(signal, 64));
  return signal;
}

TEST(SignalTest, DecodesTheBitsThatWereEncodedAndLeavesTheOthers) {
  std::mt19937_64 bits_of(1);
  std::mt19937 engine(2);
  for (int i = 0; i < 5000; ++i) {
    const DbcSignal signal = RandomSignal(engine);
    const std::uint64_t mask = ~std::uint64_t{0} >> static_cast<unsigned>(64 - signal.length);
    const std::uint64_t bits = bits_of() & mask;
    std::array<std::uint8_t, 64> zeros{};
    std::array<std::uint8_t, 64> ones{};
    ones.fill(0xFF);
    EncodeBits(signal, bits, zeros);
    EncodeBits(signal, bits, ones);
    ASSERT_EQ(DecodeBits(signal, zeros), bits);
    ASSERT_EQ(DecodeBits(signal, ones), bits);
    int differing = 0;
    for (std::size_t k = 0; k < zeros.size(); ++k)
      differing += __builtin_popcount(static_cast<unsigned>(zeros[k] ^ ones[k]));
    ASSERT_EQ(differing, 512 - signal.length);
  }
}

TEST(SignalTest, DecodesAPhysicalValueToHalfAStep) {
  std::mt19937 engine(3);
  for (int i = 0; i < 5000; ++i) {
    DbcSignal signal = RandomSignal(engine);
    signal.length = std::min(signal.length, 40);  // a double holds these
    signal.factor = std::uniform_real_distribution<>(0.001, 3.0)(engine);
    signal.offset = std::uniform_real_distribution<>(-100.0, 100.0)(engine);
    const double steps = std::ldexp(1.0, signal.length - 1) - 1.0;
    const double raw = std::uniform_real_distribution<>(0.0, std::max(steps, 0.1))(engine);
    const double value = raw * signal.factor + signal.offset;
    std::array<std::uint8_t, 64> payload{};
    const auto encoded = EncodeSignal(signal, value, payload);
    if (!encoded) continue;  // a signed single bit holds 0 and -1
    const auto decoded = DecodeSignal(signal, payload);
    ASSERT_TRUE(decoded);
    ASSERT_NEAR(*decoded, value, 0.5000001 * signal.factor);
  }
}

struct FormatCase {
  DbcSignal signal;
  std::uint64_t bits;
  std::string expected;
};

TEST(FormatValueTest, WritesTheDigitsThatTheFrameGives) {
  const DbcSignal word{.start_bit = 0, .length = 64};
  const auto of = [&](RawType type, double factor = 1.0, double offset = 0.0) {
    DbcSignal signal = word;
    signal.type = type;
    signal.factor = factor;
    signal.offset = offset;
    if (type == RawType::kFloat) signal.length = 32;
    return signal;
  };
  const std::vector<FormatCase> cases = {
      {word, 18446744073709551615U, "18446744073709551615"},
      {word, 9007199254740993U, "9007199254740993"},
      {of(RawType::kSigned), std::uint64_t{1} << 63U, "-9223372036854775808"},
      {of(RawType::kSigned, 1.0, -1.0), 9223372036854775807U, "9223372036854775806"},
      {of(RawType::kUnsigned, 3.0, 7.0), 6000000000000000001U, "18000000000000000010"},
      {of(RawType::kUnsigned, 4.0), 18446744073709551615U, "7.378697629483821e+19"},
      {of(RawType::kUnsigned, 0.1), 3, "0.3"},
      {of(RawType::kUnsigned, 0.1, -3276.8), 32769, "0.1"},
      {of(RawType::kUnsigned, 0.01, -67.67), 6767, "0"},
      {of(RawType::kUnsigned, 0.01, -67.67), 6766, "-0.01"},
      {of(RawType::kUnsigned, 0.001), 1, "0.001"},
      {of(RawType::kUnsigned, 0.1), 10, "1"},
      {of(RawType::kUnsigned, 0.001), 3999999999999999U, "3999999999999.999"},
      {of(RawType::kUnsigned, 1e-6), 5, "0.000005"},
      {of(RawType::kUnsigned, 1e-30), 1, "1e-30"},
      {of(RawType::kUnsigned, -0.5), 0, "0"},
      {of(RawType::kFloat), std::bit_cast<std::uint32_t>(0.1F), "0.1"},
      {of(RawType::kFloat, 2.0), std::bit_cast<std::uint32_t>(0.1F), "0.20000000298023224"},
      {of(RawType::kDouble), std::bit_cast<std::uint64_t>(0.1 + 0.2), "0.30000000000000004"},
      {of(RawType::kFloat), 0x7FC00000U, "nan"},
      {of(RawType::kDouble), std::bit_cast<std::uint64_t>(-HUGE_VAL), "-inf"}};
  for (const FormatCase& format_case : cases) {
    std::array<std::uint8_t, 8> payload{};
    EncodeBits(format_case.signal, format_case.bits, payload);
    const auto value = DecodeExactly(format_case.signal, payload);
    ASSERT_TRUE(value);
    EXPECT_EQ(FormatValue(format_case.signal, *value), format_case.expected);
  }
}

TEST(EncodeSignalTest, RefusesWhatTheSignalCannotHold) {
  std::array<std::uint8_t, 1> payload{};
  const DbcSignal byte{.name = "SPEED", .start_bit = 0, .length = 8, .factor = 0.5};
  EXPECT_TRUE(EncodeSignal(byte, 127.5, payload));
  EXPECT_THAT(payload, ElementsAre(0xFF));
  EXPECT_EQ(EncodeSignal(byte, 128.0, payload).error().message,
            "signal SPEED cannot hold 128, must be within 8 bits at 0.5 each and 0");
  EXPECT_FALSE(EncodeSignal(byte, -0.5, payload));
  EXPECT_FALSE(EncodeSignal(byte, std::nan(""), payload));
  EXPECT_THAT(payload, ElementsAre(0xFF));
}

/// A double next to the limit is the limit itself: no number may wrap.
TEST(EncodeSignalTest, RefusesWhat64BitsCannotHold) {
  std::array<std::uint8_t, 8> payload{};
  const DbcSignal unsigned_signal{.name = "U", .start_bit = 0, .length = 64};
  const DbcSignal signed_signal{
      .name = "S", .start_bit = 0, .length = 64, .type = RawType::kSigned};
  EXPECT_FALSE(EncodeSignal(unsigned_signal, 18446744073709551616.0, payload));
  EXPECT_FALSE(EncodeSignal(unsigned_signal, -1.0, payload));
  EXPECT_FALSE(EncodeSignal(signed_signal, 9223372036854775808.0, payload));
  EXPECT_FALSE(EncodeSignal(signed_signal, -9223372036854777856.0, payload));
  for (const double number : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    EXPECT_FALSE(EncodeSignal(unsigned_signal, number, payload));
    EXPECT_FALSE(EncodeSignal(signed_signal, number, payload));
  }
  EXPECT_EQ(payload, (std::array<std::uint8_t, 8>{}));
  ASSERT_TRUE(EncodeSignal(unsigned_signal, 18446744073709549568.0, payload));
  EXPECT_EQ(DecodeSignal(unsigned_signal, payload), 18446744073709549568.0);
  ASSERT_TRUE(EncodeSignal(signed_signal, 9223372036854774784.0, payload));
  EXPECT_EQ(DecodeSignal(signed_signal, payload), 9223372036854774784.0);
}

}  // namespace
}  // namespace relocd
