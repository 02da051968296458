#pragma once

#include <cstdint>

#include "can/checksum.h"
#include "can/dbc.h"
#include "can/signal.h"

namespace relocd {

/// What the base controller of `kWheelTicksDbc` says in a frame.
struct WheelTicks {
  std::int64_t time_ns = 0;
  std::uint64_t left = 0;
  std::uint64_t right = 0;
  std::uint64_t count = 0;
};

/// Counters of 16 bits, a frame counter of 4 bits, and a CRC.
inline constexpr const char* kWheelTicksDbc =
    "BO_ 416 WHEEL_TICKS: 8 BASE\n"
    " SG_ LEFT : 0|16@1+ (1,0) [0|65535] \"ticks\" BASE\n"
    " SG_ RIGHT : 16|16@1+ (1,0) [0|65535] \"ticks\" BASE\n"
    " SG_ COUNTER : 48|4@1+ (1,0) [0|15] \"\" BASE\n"
    " SG_ CHECKSUM : 56|8@1+ (1,0) [0|255] \"\" BASE\n";

/// The frame, protected as it must be.
inline CanFrame WheelTicksFrame(const DbcFile& dbc, const WheelTicks& ticks) {
  const DbcMessage& message = dbc.messages().front();
  CanFrame frame;
  frame.id = message.id;
  frame.receive_time = FromNanoseconds(ticks.time_ns);
  frame.size = static_cast<std::uint8_t>(message.size);
  EncodeBits(*message.FindSignal("LEFT"), ticks.left, frame.payload());
  EncodeBits(*message.FindSignal("RIGHT"), ticks.right, frame.payload());
  EncodeBits(*message.FindSignal("COUNTER"), ticks.count, frame.payload());
  const DbcSignal& checksum = *message.FindSignal("CHECKSUM");
  EncodeBits(checksum, Checksum(ChecksumRule::kCrc8J1850, frame, checksum), frame.payload());
  return frame;
}

}  // namespace relocd
