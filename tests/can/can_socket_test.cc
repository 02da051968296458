#include "can/can_socket.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/loopback_can.h"

namespace relocd {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

class CanSocketTest : public testing::Test {
 protected:
  std::optional<CanFrame> Receive() {
    auto frame = can_.Receive();
    EXPECT_TRUE(frame) << frame.error().message;
    return frame ? *frame : std::nullopt;
  }

  LoopbackCan bus_;
  CanSocket can_ = bus_.TakeReceiver();
};

TEST_F(CanSocketTest, HasNothingWhenNothingWaits) {
  EXPECT_FALSE(Receive());
  EXPECT_EQ(can_.status().state, CanBusState::kUnknown);
}

TEST_F(CanSocketTest, ReceivesFramesInOrderAndStampsThem) {
  const MonotonicTime before = MonotonicClock::now();
  bus_.Send(0x1A0, {1, 2, 3});
  bus_.Send(0x1A1 | CAN_EFF_FLAG, {});

  const auto first = Receive();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->id, (CanId{.value = 0x1A0}));
  EXPECT_THAT(first->payload(), ElementsAre(1, 2, 3));
  EXPECT_GE(first->receive_time, before - std::chrono::milliseconds(1));
  EXPECT_LE(first->receive_time, MonotonicClock::now());

  const auto second = Receive();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->id, (CanId{.value = 0x1A1, .extended = true}));
  EXPECT_GE(second->receive_time, first->receive_time);
  EXPECT_EQ(can_.status().state, CanBusState::kActive);
}

TEST_F(CanSocketTest, ReceivesCanFdFrames) {
  canfd_frame raw{};
  raw.can_id = 0x123;
  raw.len = 12;
  raw.flags = CANFD_BRS;
  raw.data[11] = 7;
  bus_.SendRecord(&raw, sizeof(raw));
  const auto frame = Receive();
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->fd);
  EXPECT_TRUE(frame->bit_rate_switch);
  EXPECT_FALSE(frame->error_state_indicator);
  ASSERT_THAT(frame->payload(), SizeIs(12));
  EXPECT_EQ(frame->payload()[11], 7);
}

TEST_F(CanSocketTest, CountsErrorAndRemoteFramesAndPassesOverThem) {
  bus_.Send(CAN_ERR_FLAG | CAN_ERR_ACK, {0, 0, 0, 0, 0, 0, 0, 0});
  bus_.Send(0x1A0 | CAN_RTR_FLAG, {});
  bus_.Send(0x1A0, {9});
  const auto frame = Receive();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->id.value, 0x1A0U);
  EXPECT_EQ(can_.status().error_frames, 1);
  EXPECT_EQ(can_.status().remote_frames, 1);
  EXPECT_EQ(can_.status().received, 1);
}

TEST_F(CanSocketTest, CountsRecordsThatAreNoFrame) {
  const std::vector<std::uint8_t> bytes(100, 0xFF);
  bus_.SendRecord(bytes.data(), 3);
  bus_.SendRecord(bytes.data(), 100);
  bus_.SendRecord(bytes.data(), CAN_MTU);  // says it has 255 bytes
  bus_.Send(0x1A0, {9});
  EXPECT_TRUE(Receive());
  EXPECT_EQ(can_.status().malformed, 3);
}

struct StateCase {
  const char* name;
  std::uint32_t classes;
  std::uint8_t controller;
  CanBusState expected;
};

class CanSocketStateTest : public testing::TestWithParam<StateCase> {};

TEST_P(CanSocketStateTest, FollowsTheControllersErrorFrames) {
  LoopbackCan bus;
  CanSocket can = bus.TakeReceiver();
  bus.Send(CAN_ERR_FLAG | GetParam().classes, {0, GetParam().controller, 0, 0, 0, 0, 0, 0});
  ASSERT_TRUE(can.Receive());
  EXPECT_EQ(can.status().state, GetParam().expected);
}

INSTANTIATE_TEST_SUITE_P(
    Errors,
    CanSocketStateTest,
    testing::ValuesIn(std::vector<StateCase>{
        {"BusOff", CAN_ERR_BUSOFF, 0, CanBusState::kBusOff},
        {"Restarted", CAN_ERR_RESTARTED, 0, CanBusState::kActive},
        {"ReceiveWarning", CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING, CanBusState::kWarning},
        {"TransmitPassive", CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE, CanBusState::kPassive},
        {"Active", CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, CanBusState::kActive},
        {"NoAcknowledgement", CAN_ERR_ACK, 0, CanBusState::kUnknown},
    }),
    [](const auto& instance) { return instance.param.name; });

TEST_F(CanSocketTest, IsActiveAgainWhenFramesComeAfterBusOff) {
  bus_.Send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0});
  bus_.Send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_FALSE(Receive());
  EXPECT_EQ(can_.status().state, CanBusState::kBusOff);
  EXPECT_EQ(can_.status().bus_off, 1);
  bus_.Send(0x1A0, {9});
  EXPECT_TRUE(Receive());
  EXPECT_EQ(can_.status().state, CanBusState::kActive);
}

TEST_F(CanSocketTest, IsUnavailableWhenThePeerIsGone) {
  bus_.Close();
  const auto frame = can_.Receive();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().kind, ErrorKind::kUnavailable);
  EXPECT_EQ(frame.error().message, "receiving from the CAN bus: the peer closed");
}

TEST(CanSocketFilterTest, GivesOnlyTheIdentifiersAskedFor) {
  LoopbackCan bus;
  CanSocket can = bus.TakeReceiver({.ids = {{.value = 0x1A0}}});
  bus.Send(0x1A1, {1});
  bus.Send(0x1A0 | CAN_EFF_FLAG, {2});
  bus.Send(0x1A0, {3});
  const auto frame = can.Receive();
  ASSERT_TRUE(frame && frame->has_value());
  EXPECT_THAT((*frame)->payload(), ElementsAre(3));
  EXPECT_EQ(can.status().received, 1);
}

TEST(CanSocketOpenTest, NamesTheInterfaceItCannotFind) {
  const auto can = CanSocket::Open("nosuchcan", {});
  ASSERT_FALSE(can);
  if (can.error().message.find("raw CAN socket") != std::string::npos) {
    GTEST_SKIP() << "this kernel has no CAN: " << can.error().message;
  }
  EXPECT_THAT(can.error().message, HasSubstr("'nosuchcan'"));
}

}  // namespace
}  // namespace relocd
