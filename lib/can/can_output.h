#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "can/can_frame.h"
#include "core/result.h"

namespace relocd {

/// Sends frames, as a vehicle's controllers do.
///
/// Thread-bound.
class CanOutput {
 public:
  struct Counters {
    std::int64_t sent = 0;
    std::int64_t dropped = 0;  ///< Since the receiver, or the interface, did not take them.
  };

  /// `unix:PATH` makes a SOCK_SEQPACKET socket of `struct can_frame` to which any number of
  /// odometryds with `can.source: unix` may connect, then and later; what is sent while there is
  /// none is lost, as on a bus. Anything else is a network interface such as `vcan0`.
  ///
  /// @return kUnavailable when there is no such interface, or it is down, or the path is taken;
  ///         with the commands that help.
  static Result<std::unique_ptr<CanOutput>> Open(const std::string& target);

  CanOutput() = default;
  virtual ~CanOutput() = default;
  CanOutput(const CanOutput&) = delete;
  CanOutput& operator=(const CanOutput&) = delete;
  CanOutput(CanOutput&&) = delete;
  CanOutput& operator=(CanOutput&&) = delete;

  /// Does not block. @return kUnavailable when the interface is gone or down.
  virtual Result<void> Send(const CanFrame& frame) = 0;

  [[nodiscard]] const Counters& counters() const { return counters_; }

 protected:
  Counters counters_;
};

}  // namespace relocd
