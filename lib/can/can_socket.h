#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "can/can_bus_status.h"
#include "can/can_frame.h"
#include "core/result.h"
#include "core/unique_fd.h"

namespace relocd {

struct CanSocketOptions {
  /// Only these are received; empty receives all. The kernel filters, so that a babbling node does
  /// not wake us.
  std::vector<CanId> ids{};
  bool fd_frames = false;  ///< Also receive CAN FD frames.
};

/// Receives data frames of one SocketCAN interface, without blocking.
///
/// Thread-bound.
class CanSocket {
 public:
  /// Opens a network interface such as `can0` or `vcan0`; it may be down.
  ///
  /// @return kUnavailable when there is no such interface, or no CAN in the kernel.
  static Result<CanSocket> Open(const std::string& interface, const CanSocketOptions& options);

  /// Takes over a non-blocking socket of `struct can_frame` or `struct canfd_frame` records. Next
  /// to a raw CAN socket that can be one end of a socketpair(AF_UNIX, SOCK_SEQPACKET), which is how
  /// tests and simulators stand in for a bus on machines whose kernel has no CAN.
  static CanSocket FromFd(UniqueFd fd, const CanSocketOptions& options = {});

  /// The oldest waiting data frame, or nothing when none waits.
  ///
  /// Error and remote frames and records that are no frame are counted, not returned. An interface
  /// that goes down shows in status(), and is no error: its frames come again when it is up.
  ///
  /// @return kUnavailable when the interface is gone, or the peer closed.
  Result<std::optional<CanFrame>> Receive();

  /// To be watched for readability by an event loop.
  [[nodiscard]] int fd() const { return fd_.get(); }
  [[nodiscard]] const CanBusStatus& status() const { return status_; }

 private:
  CanSocket(UniqueFd fd, std::vector<CanId> ids) : fd_(std::move(fd)), ids_(std::move(ids)) {}

  [[nodiscard]] bool IsWanted(const CanId& id) const;
  /// A failed recvmsg: nothing where frames may still come.
  Result<std::optional<CanFrame>> HandleReceiveError(int error);
  /// A frame that was received whole: nothing for one that is only counted.
  std::optional<CanFrame> HandleFrame(const CanFrame& frame);
  void HandleErrorFrame(const CanFrame& frame);

  UniqueFd fd_;
  std::vector<CanId> ids_;
  CanBusStatus status_;
  MonotonicTime last_receive_time_{};
};

}  // namespace relocd
