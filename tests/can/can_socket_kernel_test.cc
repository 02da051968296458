#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can/can_socket.h"

namespace relocd {
namespace {

using testing::ElementsAre;

const std::string kInterface = "vcan0";

/// Another node of vcan0, which only a kernel with CAN has:
/// `ip link add vcan0 type vcan; ip link set vcan0 up`.
class CanSocketKernelTest : public testing::Test {
 protected:
  void SetUp() override {
    auto can = CanSocket::Open(kInterface, {.ids = {{.value = 0x1A0}}});
    if (!can) GTEST_SKIP() << can.error().message;
    can_.emplace(std::move(can).value());

    node_ = UniqueFd(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(kInterface.c_str()));
    ASSERT_EQ(::bind(node_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  }

  bool Send(std::uint32_t can_id, std::initializer_list<std::uint8_t> data) {
    can_frame frame{};
    frame.can_id = can_id;
    frame.can_dlc = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), static_cast<std::uint8_t*>(frame.data));
    return ::send(node_.get(), &frame, sizeof(frame), 0) == sizeof(frame);
  }

  /// Waits for something to receive: a frame, or an error that is none of ours.
  std::optional<CanFrame> Receive() {
    pollfd waiting{.fd = can_->fd(), .events = POLLIN, .revents = 0};
    ::poll(&waiting, 1, 1000);
    auto frame = can_->Receive();
    EXPECT_TRUE(frame) << frame.error().message;
    return frame ? *frame : std::nullopt;
  }

  /// @return whether we may.
  bool SetInterfaceUp(bool up) {
    ifreq request{};
    std::copy(kInterface.begin(), kInterface.end(), static_cast<char*>(request.ifr_name));
    if (::ioctl(node_.get(), SIOCGIFFLAGS, &request) != 0) return false;
    const int flags = up ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP;
    request.ifr_flags = static_cast<short>(flags);
    if (::ioctl(node_.get(), SIOCSIFFLAGS, &request) != 0) return false;
    // The other node is told as well, by its next call unless the error is taken here.
    int pending = 0;
    socklen_t size = sizeof(pending);
    return ::getsockopt(node_.get(), SOL_SOCKET, SO_ERROR, &pending, &size) == 0;
  }

  UniqueFd node_;
  std::optional<CanSocket> can_;
};

TEST_F(CanSocketKernelTest, ReceivesOnlyTheIdentifiersAskedForAndStampsThem) {
  const MonotonicTime before = MonotonicClock::now();
  ASSERT_TRUE(Send(0x1A1, {1}));
  ASSERT_TRUE(Send(0x1A0 | CAN_EFF_FLAG, {2}));
  ASSERT_TRUE(Send(0x1A0, {3, 4}));
  const auto frame = Receive();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->id, (CanId{.value = 0x1A0}));
  EXPECT_THAT(frame->payload(), ElementsAre(3, 4));
  EXPECT_GE(frame->receive_time, before - std::chrono::milliseconds(1));
  EXPECT_LE(frame->receive_time, MonotonicClock::now());
  EXPECT_EQ(can_->status().received, 1);
}

TEST_F(CanSocketKernelTest, SeesErrorFramesInSpiteOfTheFilter) {
  ASSERT_TRUE(Send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_FALSE(Receive());
  EXPECT_EQ(can_->status().state, CanBusState::kBusOff);
}

TEST_F(CanSocketKernelTest, SurvivesAnInterfaceThatGoesDownAndUp) {
  if (!SetInterfaceUp(false)) {
    GTEST_SKIP() << "taking " << kInterface << " down: " << std::strerror(errno);
  }
  EXPECT_FALSE(Receive());
  EXPECT_EQ(can_->status().state, CanBusState::kInterfaceDown);
  EXPECT_EQ(can_->status().interface_down, 1);
  ASSERT_TRUE(SetInterfaceUp(true));
  EXPECT_TRUE(Send(0x1A0, {7}));
  const auto frame = Receive();
  ASSERT_TRUE(frame);
  EXPECT_THAT(frame->payload(), ElementsAre(7));
  EXPECT_EQ(can_->status().state, CanBusState::kActive);
}

TEST_F(CanSocketKernelTest, CountsWhatTheKernelDropped) {
  constexpr int kSent = 5000;
  for (int i = 0; i < kSent; ++i)
    ASSERT_TRUE(Send(0x1A0, {}));
  int received = 0;
  while (can_->Receive().value())
    ++received;
  ASSERT_LT(received, kSent);
  ASSERT_TRUE(Send(0x1A0, {1}));  // the next one that is kept tells of those that were not
  ASSERT_TRUE(Receive());
  EXPECT_EQ(can_->status().dropped, kSent - received);
}

}  // namespace
}  // namespace relocd
