#include "odometry/wheel_signals.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/wheel_ticks_frame.h"

namespace relocd {
namespace {

using testing::ElementsAre;

DbcFile Parse(const std::string& text) {
  auto dbc = DbcFile::Parse(text, "v.dbc");
  EXPECT_TRUE(dbc) << dbc.error().message;
  return *std::move(dbc);
}

WheelSignalsConfig TicksConfig() {
  WheelSignalsConfig config;
  config.counter_signal = "WHEEL_TICKS.COUNTER";
  config.checksum_signal = "WHEEL_TICKS.CHECKSUM";
  config.checksum_rule = "crc8_j1850";
  return config;
}

class WheelSignalsTest : public testing::Test {
 protected:
  DbcFile dbc_ = Parse(kWheelTicksDbc);
  WheelSignals signals_ = WheelSignals::Create(TicksConfig(), dbc_).value();
};

TEST_F(WheelSignalsTest, DecodesASet) {
  const auto sample = signals_.Handle(
      WheelTicksFrame(dbc_, {.time_ns = 7, .left = 0xFFFE, .right = 0x0102, .count = 3}));
  ASSERT_TRUE(sample);
  EXPECT_EQ(ToNanoseconds(sample->time), 7);
  EXPECT_THAT(sample->ticks, ElementsAre(0xFFFE, 0x0102));
  EXPECT_EQ(sample->missing_frames, 0);
  EXPECT_THAT(signals_.ids(), ElementsAre(CanId{.value = 416}));
}

TEST_F(WheelSignalsTest, RefusesABadChecksumAndTellsTheNextSet) {
  CanFrame broken = WheelTicksFrame(dbc_, {.count = 1});
  broken.data[0] ^= 0x10U;
  EXPECT_FALSE(signals_.Handle(broken));
  EXPECT_EQ(signals_.counters().bad_checksums, 1);
  const auto next = signals_.Handle(WheelTicksFrame(dbc_, {.count = 2}));
  ASSERT_TRUE(next);
  EXPECT_EQ(next->refused_frames, 1);
}

TEST_F(WheelSignalsTest, CountsTheFramesThatAreMissing) {
  ASSERT_TRUE(signals_.Handle(WheelTicksFrame(dbc_, {.count = 14})));
  const auto next = signals_.Handle(WheelTicksFrame(dbc_, {.count = 1}));  // 15 and 0 are missing
  ASSERT_TRUE(next);
  EXPECT_EQ(next->missing_frames, 2);
  EXPECT_EQ(signals_.counters().missing_frames, 2);
}

TEST_F(WheelSignalsTest, RefusesACounterThatStands) {
  ASSERT_TRUE(signals_.Handle(WheelTicksFrame(dbc_, {.count = 5})));
  EXPECT_FALSE(signals_.Handle(WheelTicksFrame(dbc_, {.left = 1, .count = 5})));
  EXPECT_EQ(signals_.counters().stuck_counters, 1);
}

TEST_F(WheelSignalsTest, RefusesAShortFrame) {
  CanFrame frame = WheelTicksFrame(dbc_, {});
  frame.size = 7;
  EXPECT_FALSE(signals_.Handle(frame));
  EXPECT_EQ(signals_.counters().short_frames, 1);
}

TEST_F(WheelSignalsTest, PassesOverOtherFrames) {
  CanFrame frame = WheelTicksFrame(dbc_, {});
  frame.id.extended = true;
  EXPECT_FALSE(signals_.Handle(frame));
  EXPECT_EQ(signals_.counters().frames, 0);
}

TEST(WheelSignalsSetTest, WaitsForBothMessagesOfASet) {
  const DbcFile dbc = Parse(
      "BO_ 1 L: 2 X\n SG_ SPEED : 0|16@1- (0.01,0) [0|0] \"m/s\" X\n"
      "BO_ 2 R: 2 X\n SG_ SPEED : 0|16@1- (0.01,0) [0|0] \"m/s\" X\n");
  WheelSignalsConfig config{.kind = "speed", .left_signal = "L.SPEED", .right_signal = "R.SPEED"};
  WheelSignals signals = WheelSignals::Create(config, dbc).value();
  CanFrame left;
  left.id.value = 1;
  left.SetPayload(std::array<std::uint8_t, 2>{100, 0});
  CanFrame right;
  right.id.value = 2;
  right.receive_time = FromNanoseconds(5);
  right.SetPayload(std::array<std::uint8_t, 2>{0x9C, 0xFF});
  EXPECT_FALSE(signals.Handle(left));
  const auto sample = signals.Handle(right);
  ASSERT_TRUE(sample);
  EXPECT_THAT(sample->speeds_mps, ElementsAre(1.0, -1.0));
  EXPECT_EQ(ToNanoseconds(sample->time), 5);
  EXPECT_FALSE(signals.Handle(right));
}

TEST(WheelSignalsSetTest, CountsAndLeavesOutSpeedsThatAreNotFinite) {
  const DbcFile dbc = Parse(
      "BO_ 1 L: 8 X\n SG_ LEFT : 0|32@1- (1,0) [0|0] \"m/s\" X\n"
      " SG_ RIGHT : 32|32@1- (1,0) [0|0] \"m/s\" X\n"
      "SIG_VALTYPE_ 1 LEFT : 1;\nSIG_VALTYPE_ 1 RIGHT : 1;\n");
  WheelSignalsConfig config{.kind = "speed", .left_signal = "L.LEFT", .right_signal = "L.RIGHT"};
  WheelSignals signals = WheelSignals::Create(config, dbc).value();
  CanFrame frame;
  frame.id.value = 1;
  frame.SetPayload(std::array<std::uint8_t, 8>{0, 0, 0x80, 0x3F, 0, 0, 0xC0, 0x7F});  // 1, NaN
  EXPECT_FALSE(signals.Handle(frame));
  EXPECT_EQ(signals.counters().non_finite, 1);
  frame.SetPayload(std::array<std::uint8_t, 8>{0, 0, 0x80, 0x3F, 0, 0, 0x80, 0x3F});  // 1, 1
  const auto sample = signals.Handle(frame);
  ASSERT_TRUE(sample);
  EXPECT_THAT(sample->speeds_mps, ElementsAre(1.0, 1.0));
  EXPECT_EQ(signals.counters().non_finite, 1);
}

/// Left and right wheel in messages of their own, each with a counter.
constexpr const char* kTwoMessagesDbc =
    "BO_ 1 L: 3 X\n SG_ SPEED : 0|16@1- (0.01,0) [0|0] \"m/s\" X\n"
    " SG_ COUNT : 16|4@1+ (1,0) [0|0] \"\" X\n"
    "BO_ 2 R: 3 X\n SG_ SPEED : 0|16@1- (0.01,0) [0|0] \"m/s\" X\n"
    " SG_ COUNT : 16|4@1+ (1,0) [0|0] \"\" X\n";

CanFrame SideFrame(std::uint32_t id, double time_s, std::uint8_t count) {
  CanFrame frame;
  frame.id.value = id;
  frame.receive_time = MonotonicTime(FromSeconds(time_s));
  frame.SetPayload(std::array<std::uint8_t, 3>{100, 0, count});
  return frame;
}

TEST(WheelSignalsSetTest, JudgesEachMessageByItsOwnRule) {
  const DbcFile dbc = Parse(kTwoMessagesDbc);
  const WheelSignalsConfig config{
      .kind = "speed", .left_signal = "L.SPEED", .right_signal = "R.SPEED"};
  WheelSignals signals = WheelSignals::Create(config, dbc, {{"R", {.counter = "COUNT"}}}).value();
  EXPECT_FALSE(signals.Handle(SideFrame(1, 0.0, 0)));
  EXPECT_TRUE(signals.Handle(SideFrame(2, 0.0, 0)));
  EXPECT_FALSE(signals.Handle(SideFrame(1, 0.1, 0)));  // stands, but nobody said that it counts
  EXPECT_FALSE(signals.Handle(SideFrame(2, 0.1, 0)));
  EXPECT_EQ(signals.counters().stuck_counters, 1);
  EXPECT_TRUE(signals.Handle(SideFrame(2, 0.1, 1)));
}

TEST(WheelSignalsSetTest, DropsWhatWaitedTooLongForTheRest) {
  const DbcFile dbc = Parse(kTwoMessagesDbc);
  const WheelSignalsConfig config{
      .kind = "speed", .left_signal = "L.SPEED", .right_signal = "R.SPEED"};
  WheelSignals signals = WheelSignals::Create(config, dbc, {{"L", {.max_age_s = 0.05}}}).value();
  EXPECT_FALSE(signals.Handle(SideFrame(1, 0.0, 0)));
  EXPECT_FALSE(signals.Handle(SideFrame(2, 0.06, 0)));
  EXPECT_TRUE(signals.Handle(SideFrame(1, 0.07, 0)));
}

std::string CreateError(const WheelSignalsConfig& config) {
  const auto signals = WheelSignals::Create(config, Parse(kWheelTicksDbc));
  return signals ? "" : signals.error().message;
}

TEST(WheelSignalsCreateTest, NamesTheSignalThatIsMissing) {
  WheelSignalsConfig config = TicksConfig();
  config.left_signal = "WHEEL_TICKS.LEFT_";
  EXPECT_EQ(CreateError(config),
            "v.dbc: has no signal 'WHEEL_TICKS.LEFT_', nearest are WHEEL_TICKS.LEFT, "
            "WHEEL_TICKS.RIGHT, WHEEL_TICKS.COUNTER");
}

TEST(WheelSignalsCreateTest, NamesAChecksumThatIsNone) {
  WheelSignalsConfig config = TicksConfig();
  config.checksum_signal = "WHEEL_TICKS.COUNTER";
  EXPECT_EQ(
      CreateError(config),
      "v.dbc: checksum signal 'WHEEL_TICKS.COUNTER' has 4 bits from bit 48, must have 8, a whole "
      "byte");
}

TEST(WheelSignalsConfigTest, AcceptsItsDefaultsAndNamesWhatIsWrong) {
  const auto error_of = [](const WheelSignalsConfig& config) {
    const auto valid = config.Validate();
    return valid ? "" : valid.error().message;
  };
  EXPECT_EQ(error_of({}), "");
  EXPECT_EQ(error_of({.kind = "pulses"}), "kind is 'pulses', must be one of ticks, speed");
  EXPECT_EQ(error_of({.checksum_rule = "sum"}),
            "checksum_rule is 'sum', must be one of " + ChecksumRuleNames());
  EXPECT_EQ(
      error_of({.checksum_rule = "xor8"}),
      "checksum_rule is 'xor8' and checksum_signal '', must be none with an empty signal, and "
      "not none with one");
  EXPECT_EQ(
      error_of({.kind = "speed", .front_left_signal = "A.B"}),
      "front_right_signal is '' and front_left_signal 'A.B', must be both given or both empty");
  EXPECT_EQ(error_of({.speed_unit_mps = 0.0}), "speed_unit_mps is 0, must be positive and finite");
  EXPECT_EQ(error_of({.counter_step = 0}), "counter_step is 0, must be at least 1");
}

}  // namespace
}  // namespace relocd
