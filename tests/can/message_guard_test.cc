#include "can/message_guard.h"

#include <string>

#include <gtest/gtest.h>

#include "can/signal.h"
#include "can/signal_reader.h"
#include "support/wheel_ticks_frame.h"

namespace relocd {
namespace {

DbcFile Dbc() {
  return DbcFile::Parse(kWheelTicksDbc, "v.dbc").value();
}

MessageGuard Guard(const MessageRule& rule) {
  auto guard = MessageGuard::Create(rule, Dbc().messages().front());
  EXPECT_TRUE(guard) << guard.error().message;
  return *std::move(guard);
}

TEST(MessageGuardTest, RefusesAWrongChecksumAndAShortFrame) {
  MessageGuard guard = Guard({.checksum = "CHECKSUM", .checksum_rule = "crc8_j1850"});
  CanFrame frame = WheelTicksFrame(Dbc(), {.left = 7});
  EXPECT_EQ(guard.Judge(frame).verdict, FrameVerdict::kValid);
  for (int bit = 0; bit < 64; ++bit) {
    CanFrame broken = frame;
    broken.data.at(static_cast<std::size_t>(bit / 8)) ^=
        static_cast<std::uint8_t>(1U << (bit % 8U));
    EXPECT_EQ(guard.Judge(broken).verdict, FrameVerdict::kBadChecksum) << bit;
  }
  frame.size = 7;
  EXPECT_EQ(guard.Judge(frame).verdict, FrameVerdict::kShort);
  EXPECT_EQ(guard.counters().bad_checksums, 64);
  EXPECT_EQ(guard.counters().short_frames, 1);
}

TEST(MessageGuardTest, CountsMissingFramesAcrossTheWrap) {
  MessageGuard guard = Guard({.counter = "COUNTER"});
  const auto judge = [&](std::uint64_t count) {
    return guard.Judge(WheelTicksFrame(Dbc(), {.count = count}));
  };
  EXPECT_EQ(judge(14).missing_frames, 0);
  EXPECT_EQ(judge(15).missing_frames, 0);
  EXPECT_EQ(judge(0).missing_frames, 0);
  EXPECT_EQ(judge(0).verdict, FrameVerdict::kStuckCounter);
  EXPECT_EQ(judge(3).missing_frames, 2);
  EXPECT_EQ(judge(2).missing_frames, 14);
}

TEST(MessageGuardTest, KnowsACounterThatWrapsBeforeItsBits) {
  MessageGuard guard = Guard({.counter = "COUNTER", .counter_modulo = 15});
  const auto judge = [&](std::uint64_t count) {
    return guard.Judge(WheelTicksFrame(Dbc(), {.count = count})).missing_frames;
  };
  EXPECT_EQ(judge(14), 0);
  EXPECT_EQ(judge(0), 0);  // profile 1 never sends 15
  EXPECT_EQ(judge(13), 12);
}

TEST(MessageGuardTest, TakesACountThatIsNotBelowTheModuloForItsRemainder) {
  MessageGuard guard = Guard({.counter = "COUNTER", .counter_modulo = 10});
  const auto judge = [&](std::uint64_t count) {
    return guard.Judge(WheelTicksFrame(Dbc(), {.count = count})).missing_frames;
  };
  EXPECT_EQ(judge(14), 0);
  EXPECT_EQ(judge(1), 6);  // 4 to 11
}

TEST(MessageGuardTest, CountsWithSteps) {
  MessageGuard guard = Guard({.counter = "COUNTER", .counter_step = 4});
  const auto judge = [&](std::uint64_t count) {
    return guard.Judge(WheelTicksFrame(Dbc(), {.count = count})).missing_frames;
  };
  EXPECT_EQ(judge(8), 0);
  EXPECT_EQ(judge(12), 0);
  EXPECT_EQ(judge(4), 1);
}

TEST(MessageGuardTest, NamesWhatDoesNotFit) {
  const auto error_of = [](const MessageRule& rule) {
    const auto guard = MessageGuard::Create(rule, Dbc().messages().front());
    return guard ? "" : guard.error().message;
  };
  EXPECT_EQ(error_of({.counter = "COUNT"}),
            "counter is 'COUNT', must be an integer of message WHEEL_TICKS that is in each frame");
  EXPECT_EQ(error_of({.checksum = "CHECKSUM", .checksum_rule = "honda"}),
            "checksum signal 'WHEEL_TICKS.CHECKSUM' has 8 bits from bit 56, must have 4");
  EXPECT_EQ(error_of({.counter_modulo = 1}), "counter_modulo is 1, must be 0 or at least 2");
  EXPECT_EQ(error_of({.counter_step = 15, .counter_modulo = 15}),
            "counter_step is 15, must be below the counter_modulo of 15");
  EXPECT_EQ(error_of({.counter = "COUNTER", .counter_modulo = 17}),
            "counter_modulo is 17, must be at most 16: counter signal 'WHEEL_TICKS.COUNTER' has 4 "
            "bits");
  EXPECT_EQ(error_of({.counter = "COUNTER", .counter_modulo = 16}), "");
  EXPECT_EQ(error_of({.counter = "COUNTER", .counter_step = 16}),
            "counter_step is 16, must be at most 15: counter signal 'WHEEL_TICKS.COUNTER' has 4 "
            "bits");
  EXPECT_EQ(error_of({.data_id = 65536}), "data_id is 65536, must be in [0, 65535]");
  EXPECT_EQ(error_of({.max_age_s = 0.0}), "max_age_s is 0, must be in (0, 1e6)");
  EXPECT_EQ(error_of({.checksum = "CHECKSUM", .checksum_rule = "autosar_p1_alternating"}),
            "counter is '', must be given with autosar_p1_alternating");
}

TEST(SignalReaderTest, HasAValueWhileItIsValidAndNotTooOld) {
  auto reader = SignalReader::Create(
      "WHEEL_TICKS.LEFT",
      Dbc(),
      {{"WHEEL_TICKS", {.checksum = "CHECKSUM", .checksum_rule = "crc8_j1850", .max_age_s = 0.1}}});
  ASSERT_TRUE(reader) << reader.error().message;
  EXPECT_FALSE(reader->ValueAt(FromNanoseconds(0)));
  EXPECT_EQ(reader->Handle(WheelTicksFrame(Dbc(), {.time_ns = 1000, .left = 7})), 7.0);
  CanFrame broken = WheelTicksFrame(Dbc(), {.time_ns = 2000, .left = 8});
  broken.data[0] ^= 1U;
  EXPECT_FALSE(reader->Handle(broken));
  EXPECT_EQ(reader->ValueAt(FromNanoseconds(100'001'000)), 7.0);
  EXPECT_FALSE(reader->ValueAt(FromNanoseconds(100'001'001)));
}

}  // namespace
}  // namespace relocd
