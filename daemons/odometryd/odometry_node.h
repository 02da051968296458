#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "relocd/can_frames_t.hpp"
#include "relocd/odometry_t.hpp"

#include "can/can_bus_status.h"
#include "can/can_config.h"
#include "can/can_frame.h"
#include "core/time.h"
#include "messaging/message_bus.h"
#include "messaging/node_status.h"
#include "odometry/wheel_odometry.h"

namespace relocd {

/// Turns CAN frames into ODOMETRY, one message for each set of wheel measurements, and passes the
/// frames on as CAN_<interface>, in batches.
///
/// Borrows the bus, which must outlive it. Thread-bound.
class OdometryNode {
 public:
  OdometryNode(const CanConfig& can, WheelOdometry odometry, MessageBus& bus, std::int64_t run_id);

  /// Frames from a bus, in the order of their reception.
  void HandleFrames(std::span<const CanFrame> frames, const ClockReading& now);
  /// What is known of that bus.
  void HandleBusStatus(const CanBusStatus& status, const ClockReading& now);
  /// The source of frames is lost, for this reason, or there again: an empty one.
  void HandleSourceError(const std::string& error) { source_error_ = error; }

  /// Recorded frames: the same as HandleFrames, without passing them on.
  void Handle(const can_frames_t& message);

  /// To be called every 10 ms, after HandleFrames: publishes the batch of frames, and guesses while
  /// no measurement comes.
  void Tick(const ClockReading& now);

  [[nodiscard]] NodeStatus Status(const ClockReading& now) const;

 private:
  void HandleFrame(const CanFrame& frame, const ClockReading& now);
  void PublishOdometry(const OdometryIncrement& increment, const ClockReading& now);
  void PublishFrames(const ClockReading& now);
  void RaiseLevel(const ClockReading& now, NodeStatus& status) const;

  std::string interface_;
  Channel<can_frames_t> can_channel_;
  WheelOdometry odometry_;
  MessageBus& bus_;
  std::int64_t run_id_;

  std::int64_t odometry_seq_ = 0;
  std::int64_t can_seq_ = 0;
  std::int64_t publish_failures_ = 0;
  std::vector<CanFrame> batch_;
  CanBusStatus bus_status_;
  std::optional<MonotonicTime> bus_off_since_;
  CanBusState published_state_ = CanBusState::kUnknown;
  std::string source_error_;

  std::optional<MonotonicTime> last_measurement_;
  std::optional<MonotonicTime> last_trouble_;  ///< An increment that was flagged for a fault.
  std::int32_t trouble_flags_ = 0;
  std::deque<MonotonicTime> published_;  ///< When the last ones were, for the rate.
  std::deque<Duration> ages_;            ///< Of their measurements then.
};

}  // namespace relocd
