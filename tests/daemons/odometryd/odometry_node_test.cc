#include "odometryd/odometry_node.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can/socket_can_source.h"
#include "messaging/in_process_bus.h"
#include "support/loopback_can.h"
#include "support/wheel_ticks_frame.h"

namespace relocd {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kRunId = 77;
constexpr std::int64_t kBootUs = 1'700'000'000'000'000;  // CLOCK_REALTIME of monotonic zero

ClockReading At(std::int64_t time_ns) {
  return {.monotonic = FromNanoseconds(time_ns), .realtime_us = kBootUs + time_ns / 1000};
}

/// One tick is one millimetre.
OdometryConfig TicksConfig() {
  OdometryConfig config;
  config.wheels.counter_signal = "WHEEL_TICKS.COUNTER";
  config.wheels.checksum_signal = "WHEEL_TICKS.CHECKSUM";
  config.wheels.checksum_rule = "crc8_j1850";
  config.drive.left_radius_m = 0.5 / std::numbers::pi;
  config.drive.right_radius_m = 0.5 / std::numbers::pi;
  config.drive.ticks_per_revolution = 1000;
  return config;
}

double ValueOf(const NodeStatus& status, const std::string& name) {
  for (const StatusValue& value : status.values) {
    if (value.name == name) return value.value;
  }
  ADD_FAILURE() << "STATUS has no " << name;
  return 0.0;
}

class OdometryNodeTest : public testing::Test {
 protected:
  OdometryNodeTest() {
    bus_.Subscribe<odometry_t>(channels::kOdometry, Delivery::kEvery, [this](const odometry_t& m) {
      odometry_.push_back(m);
    });
    bus_.Subscribe<can_frames_t>(
        CanChannel("can0"), Delivery::kEvery, [this](const can_frames_t& m) { can_.push_back(m); });
  }

  OdometryNode MakeNode() {
    return {CanConfig(), WheelOdometry::Create(TicksConfig(), dbc_).value(), bus_, kRunId};
  }

  /// Drives 10 mm within 10 ms.
  CanFrame NextFrame() {
    ticks_.time_ns += 10'000'000;
    ticks_.left += 10;
    ticks_.right += 10;
    ticks_.count = (ticks_.count + 1) & 0xFU;
    return WheelTicksFrame(dbc_, ticks_);
  }

  void Send(OdometryNode& node, const CanFrame& frame) {
    node.HandleFrames({&frame, 1}, At(ticks_.time_ns + 1'000'000));
    bus_.HandlePending();
  }
  void Tick(OdometryNode& node, std::int64_t time_ns) {
    node.Tick(At(time_ns));
    bus_.HandlePending();
  }

  const DbcFile dbc_ = DbcFile::Parse(kWheelTicksDbc, "v.dbc").value();
  InProcessBus bus_;
  WheelTicks ticks_{.time_ns = 1'000'000'000};
  OdometryNode node_ = MakeNode();
  std::vector<odometry_t> odometry_;
  std::vector<can_frames_t> can_;
};

TEST_F(OdometryNodeTest, PublishesOdometryForEachFrame) {
  for (int i = 0; i < 3; ++i)
    Send(node_, NextFrame());
  ASSERT_EQ(odometry_.size(), 3U);
  const odometry_t& last = odometry_[2];
  EXPECT_EQ(last.seq, 2);
  EXPECT_EQ(last.run_id, kRunId);
  EXPECT_EQ(last.mono_ns, ticks_.time_ns);
  EXPECT_EQ(last.utime, kBootUs + ticks_.time_ns / 1000);
  EXPECT_EQ(last.prev_mono_ns, odometry_[1].mono_ns);
  EXPECT_NEAR(last.dx_m, 0.01, 1e-12);
  EXPECT_NEAR(last.x_OB_m, 0.02, 1e-12);
  EXPECT_NEAR(last.speed_mps, 1.0, 1e-9);
  EXPECT_GT(last.motion_covariance[0], 0.0);
  EXPECT_EQ(last.motion_covariance[1], last.motion_covariance[3]);
  EXPECT_THAT(last.ticks, testing::ElementsAre(30, 30));
  EXPECT_EQ(last.flags, 0);
}

TEST_F(OdometryNodeTest, PassesFramesOnInBatches) {
  Send(node_, NextFrame());
  Send(node_, NextFrame());
  EXPECT_TRUE(can_.empty());
  Tick(node_, ticks_.time_ns + 5'000'000);
  ASSERT_EQ(can_.size(), 1U);
  EXPECT_EQ(can_[0].n, 2);
  EXPECT_EQ(can_[0].mono_ns, ticks_.time_ns);
  EXPECT_EQ(can_[0].frames[1].can_id, 416);
  EXPECT_EQ(can_[0].frames[1].size, 8);
  Tick(node_, ticks_.time_ns + 15'000'000);
  EXPECT_EQ(can_.size(), 1U);
}

TEST_F(OdometryNodeTest, TellsAChangeOfTheBusWithoutFrames) {
  node_.HandleBusStatus({.state = CanBusState::kBusOff, .error_frames = 3}, At(2'000'000'000));
  Tick(node_, 2'000'000'000);
  ASSERT_EQ(can_.size(), 1U);
  EXPECT_EQ(can_[0].n, 0);
  EXPECT_EQ(can_[0].bus_state, 4);
  EXPECT_EQ(can_[0].error_frames, 3);
}

TEST_F(OdometryNodeTest, RecordedFramesGiveTheSameOdometry) {
  for (int i = 0; i < 5; ++i)
    Send(node_, NextFrame());
  Tick(node_, ticks_.time_ns);
  ASSERT_EQ(can_.size(), 1U);
  const std::vector<odometry_t> live = std::exchange(odometry_, {});

  OdometryNode replayed = MakeNode();
  replayed.Handle(can_[0]);
  bus_.HandlePending();
  ASSERT_EQ(odometry_.size(), live.size());
  for (std::size_t i = 0; i < live.size(); ++i) {
    EXPECT_EQ(odometry_[i].mono_ns, live[i].mono_ns);
    EXPECT_EQ(odometry_[i].utime, live[i].utime);
    EXPECT_EQ(odometry_[i].x_OB_m, live[i].x_OB_m);
    EXPECT_EQ(odometry_[i].motion_covariance[0], live[i].motion_covariance[0]);
  }
  EXPECT_EQ(can_.size(), 1U);  // not passed on again
}

TEST_F(OdometryNodeTest, GuessesWhileTheWheelsAreSilentAndRecovers) {
  Send(node_, NextFrame());
  Send(node_, NextFrame());
  const std::int64_t lost_ns = ticks_.time_ns;
  EXPECT_EQ(node_.Status(At(lost_ns)).level, status_t::OK);
  for (int i = 1; i <= 100; ++i)
    Tick(node_, lost_ns + i * 10'000'000);
  ASSERT_EQ(odometry_.size(), 2U + 8U);  // from 0.21 s on, ten a second
  EXPECT_EQ(odometry_.back().flags, odometry_t::FLAG_STALE);
  const NodeStatus status = node_.Status(At(lost_ns + 1'000'000'000));
  EXPECT_EQ(status.level, status_t::ERROR);
  EXPECT_EQ(status.message, "no wheel measurement for 1.0 s");

  ticks_.time_ns += 1'000'000'000;
  Send(node_, NextFrame());
  EXPECT_EQ(odometry_.back().flags & odometry_t::FLAG_GAP, odometry_t::FLAG_GAP);
  EXPECT_NEAR(odometry_.back().x_OB_m, 0.02, 1e-12);
  EXPECT_EQ(node_.Status(At(ticks_.time_ns)).level, status_t::WARNING);
  EXPECT_EQ(node_.Status(At(ticks_.time_ns)).message, "measurements missing");
  EXPECT_EQ(odometry_.back().prev_mono_ns, odometry_[odometry_.size() - 2].mono_ns);
}

TEST_F(OdometryNodeTest, SaysWhatIsWrongWithTheBus) {
  EXPECT_EQ(node_.Status(At(0)).level, status_t::WARNING);
  EXPECT_EQ(node_.Status(At(0)).message, "no wheel measurement yet in 0 frames of can0");
  node_.HandleBusStatus({.state = CanBusState::kInterfaceDown}, At(1));
  EXPECT_EQ(node_.Status(At(1)).message, "can0 is down: ip link set can0 up");
  node_.HandleBusStatus({.state = CanBusState::kBusOff}, At(0));
  EXPECT_EQ(node_.Status(At(500'000'000)).level, status_t::WARNING);  // it may restart by itself
  EXPECT_THAT(node_.Status(At(3'000'000'000)).message,
              HasSubstr("can0 has been bus off for 3 s: ip link set can0 down; ip link set can0 "
                        "type can restart-ms 100"));
  node_.HandleSourceError("can0: No such device");
  EXPECT_EQ(node_.Status(At(0)).message, "can0: No such device");
}

TEST_F(OdometryNodeTest, AClockThatJumpsBackIsFollowedCountedAndNamed) {
  ticks_.time_ns = 7'200'000'000'000;
  for (int i = 0; i < 10; ++i)
    Send(node_, NextFrame());
  ticks_.time_ns -= 3'600'000'000'000;
  for (int i = 0; i < 200; ++i)
    Send(node_, NextFrame());
  ASSERT_EQ(odometry_.size(), 10U + 101U);
  EXPECT_EQ(odometry_[10].flags, odometry_t::FLAG_JUMP);
  EXPECT_EQ(odometry_[10].prev_mono_ns, odometry_[10].mono_ns);
  const NodeStatus status = node_.Status(At(ticks_.time_ns));
  EXPECT_EQ(ValueOf(status, "out_of_order"), 100.0);
  EXPECT_EQ(ValueOf(status, "clock_jumps"), 1.0);
  EXPECT_EQ(status.level, status_t::WARNING);
}

TEST_F(OdometryNodeTest, ABadChecksumIsFlaggedAndCounted) {
  Send(node_, NextFrame());
  CanFrame broken = NextFrame();
  broken.data[0] ^= 1U;
  Send(node_, broken);
  Send(node_, NextFrame());
  ASSERT_EQ(odometry_.size(), 2U);
  EXPECT_EQ(odometry_.back().flags, kOdometryChecksum | kOdometryGap);
  EXPECT_EQ(node_.Status(At(ticks_.time_ns)).message,
            "measurements missing, bad checksum or counter");
}

/// From a socket to messages, in one process: no CAN in the kernel, no network, no sleeps.
TEST_F(OdometryNodeTest, FollowsABusThatGoesAndComesAgain) {
  LoopbackCan first;
  LoopbackCan second;
  int opened = 0;
  SocketCanSource source("test bus", [&]() -> Result<CanSocket> {
    return ++opened == 1 ? first.TakeReceiver() : second.TakeReceiver();
  });
  const auto drain = [&] {
    while (true) {
      const auto frame = source.Receive();
      if (!frame || !frame->has_value()) return;
      const CanFrame received = **frame;
      node_.HandleFrames({&received, 1}, ReadClocks());
      bus_.HandlePending();
    }
  };
  ASSERT_TRUE(source.Open());
  first.Send(NextFrame());
  first.Send(0x123, {0xAA});  // another node's frame
  first.Send(NextFrame());
  first.Close();
  drain();
  EXPECT_FALSE(source.is_open());
  ASSERT_TRUE(source.Open());
  second.Send(NextFrame());
  drain();
  ASSERT_EQ(odometry_.size(), 3U);
  EXPECT_NEAR(odometry_.back().x_OB_m, 0.02, 1e-12);
}

}  // namespace
}  // namespace relocd
