#pragma once

#include <cstdint>
#include <string_view>

namespace relocd {

/// What is known of the bus, from the driver's error frames and the socket's errors. The numbers
/// are those of can_frames_t.bus_state.
enum class CanBusState {
  kUnknown = 0,  ///< Nothing was received yet.
  kActive = 1,
  kWarning = 2,  ///< An error counter passed 96.
  kPassive = 3,  ///< An error counter passed 127.
  kBusOff = 4,   ///< The controller left the bus.
  kInterfaceDown = 5,
};

constexpr std::string_view ToString(CanBusState state) {
  switch (state) {
    case CanBusState::kUnknown:
      return "unknown";
    case CanBusState::kActive:
      return "active";
    case CanBusState::kWarning:
      return "warning";
    case CanBusState::kPassive:
      return "passive";
    case CanBusState::kBusOff:
      return "bus off";
    case CanBusState::kInterfaceDown:
      return "interface down";
  }
  return "unknown";
}

/// What a source of frames has seen since it was made.
struct CanBusStatus {
  CanBusState state = CanBusState::kUnknown;
  std::int64_t received = 0;        ///< Data frames.
  std::int64_t remote_frames = 0;   ///< Passed over.
  std::int64_t error_frames = 0;    ///< Passed over.
  std::int64_t malformed = 0;       ///< Records that are no frame, passed over.
  std::int64_t dropped = 0;         ///< Frames that the kernel dropped, the queue being full.
  std::int64_t bus_off = 0;         ///< Times the controller left the bus.
  std::int64_t interface_down = 0;  ///< Times the interface went down.
};

}  // namespace relocd
