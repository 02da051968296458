#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "can/can_frame.h"
#include "can/checksum.h"
#include "can/dbc.h"
#include "core/result.h"
#include "odometry/wheel_odometry.h"
#include "simulation/wheel_sensors.h"

namespace relocd {

/// Writes what a vehicle's sensors say into frames, as its config and its DBC file describe them:
/// ticks that wrap or speeds, steering and yaw rate, with frame counters and checksums.
///
/// The config names the counter and the checksum of the left wheel's message; signals of the same
/// names in the other messages are of the same kind.
class WheelFrameEncoder {
 public:
  /// @return kInvalidInput, as WheelSignals::Create.
  static Result<WheelFrameEncoder> Create(const OdometryConfig& vehicle,
                                          const DbcFile& dbc,
                                          const WheelSimulationOptions& options);

  /// One frame of each message. @return kInvalidInput for a value that its signal cannot hold.
  Result<std::vector<CanFrame>> Encode(const WheelReading& reading);

 private:
  struct Message {
    DbcMessage message;
    std::optional<DbcSignal> counter;
    std::optional<DbcSignal> checksum;
    std::uint64_t count = 0;
  };
  /// Where a signal goes, and what it says.
  struct Field {
    std::size_t message = 0;  ///< Index into messages_.
    DbcSignal signal;
    enum class Content { kWheel, kSteering, kYawRate } content = Content::kWheel;
    std::size_t wheel = 0;
  };

  WheelFrameEncoder(const OdometryConfig& vehicle, const DbcFile& dbc);

  void AddField(const DbcFile& dbc,
                const std::string& name,
                Field::Content content,
                std::size_t wheel);
  Result<void> EncodeField(const Field& field, const WheelReading& reading, CanFrame& frame) const;
  Result<void> EncodeWheel(const Field& field, const WheelReading& reading, CanFrame& frame) const;
  void Protect(Message& message, CanFrame& frame) const;

  OdometryConfig vehicle_;
  std::vector<Message> messages_;
  std::vector<Field> fields_;
  ChecksumRule rule_ = ChecksumRule::kNone;
};

}  // namespace relocd
