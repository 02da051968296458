#pragma once

#include <linux/can.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <utility>

#include <gtest/gtest.h>

#include "can/can_socket.h"

namespace relocd {

/// A bus of two: a CanSocket under test, and a test that sends to it.
class LoopbackCan {
 public:
  LoopbackCan() {
    std::array<int, 2> fds{-1, -1};
    const int type = SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC;
    EXPECT_EQ(::socketpair(AF_UNIX, type, 0, fds.data()), 0);
    receiver_ = UniqueFd(fds[0]);
    sender_ = UniqueFd(fds[1]);
  }

  /// To be called once.
  CanSocket TakeReceiver() { return CanSocket::FromFd(std::move(receiver_)); }

  void Send(std::uint32_t id, std::initializer_list<int> data) {
    can_frame frame{};
    frame.can_id = id;
    frame.can_dlc = static_cast<std::uint8_t>(data.size());
    std::transform(data.begin(), data.end(), frame.data, [](int byte) {
      return static_cast<std::uint8_t>(byte);
    });
    EXPECT_EQ(::send(sender_.get(), &frame, sizeof(frame), 0), static_cast<ssize_t>(sizeof(frame)));
  }

  void Close() { sender_ = UniqueFd(); }

 private:
  UniqueFd receiver_;
  UniqueFd sender_;
};

}  // namespace relocd
