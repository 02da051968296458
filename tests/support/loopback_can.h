#pragma once

#include <linux/can.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <utility>
#include <vector>

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
  CanSocket TakeReceiver(const CanSocketOptions& options = {}) {
    return CanSocket::FromFd(std::move(receiver_), options);
  }

  void Send(std::uint32_t id, std::span<const std::uint8_t> data) {
    can_frame frame{};
    frame.can_id = id;
    frame.can_dlc = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), static_cast<std::uint8_t*>(frame.data));
    SendRecord(&frame, sizeof(frame));
  }
  void Send(std::uint32_t id, std::initializer_list<int> data) {
    std::vector<std::uint8_t> bytes;
    for (const int byte : data)
      bytes.push_back(static_cast<std::uint8_t>(byte));
    Send(id, bytes);
  }
  void Send(const CanFrame& frame) { Send(KernelCanId(frame), frame.payload()); }

  /// Any bytes, as one record.
  void SendRecord(const void* bytes, std::size_t size) {
    EXPECT_EQ(::send(sender_.get(), bytes, size, 0), static_cast<ssize_t>(size));
  }

  void Close() { sender_ = UniqueFd(); }

 private:
  UniqueFd receiver_;
  UniqueFd sender_;
};

}  // namespace relocd
