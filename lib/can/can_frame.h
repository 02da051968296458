#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>

#include "core/time.h"

namespace relocd {

/// Who a frame is from: its identifier, of 11 bits, or of 29 when extended.
///
/// 0x123 of 11 bits and 0x123 of 29 bits are two different identifiers.
struct CanId {
  std::uint32_t value = 0;  ///< Without the kernel's flag bits.
  bool extended = false;

  friend bool operator==(const CanId&, const CanId&) = default;
  friend bool operator<(const CanId& left, const CanId& right) {
    return std::tie(left.extended, left.value) < std::tie(right.extended, right.value);
  }
};

/// One data, remote or error frame, classical or CAN FD.
struct CanFrame {
  static constexpr std::size_t kMaxSize = 64;
  static constexpr std::size_t kMaxClassicalSize = 8;

  CanId id;
  MonotonicTime receive_time{};  ///< When the kernel received it.
  bool remote = false;           ///< A request for a frame, without data.
  bool error = false;  ///< Written by the driver: `id` and `data` are of <linux/can/error.h>.
  bool fd = false;     ///< CAN FD.
  bool bit_rate_switch = false;        ///< CAN FD: the data came at the second bit rate.
  bool error_state_indicator = false;  ///< CAN FD: the sender is error passive.
  std::uint8_t size = 0;               ///< Bytes of `data` in use: at most 8, with CAN FD 64.
  std::array<std::uint8_t, kMaxSize> data{};

  [[nodiscard]] std::span<const std::uint8_t> payload() const { return {data.data(), size}; }
  [[nodiscard]] std::span<std::uint8_t> payload() { return {data.data(), size}; }

  /// Copies as much of `bytes` as a CAN FD frame holds.
  void SetPayload(std::span<const std::uint8_t> bytes) {
    size = static_cast<std::uint8_t>(std::min(bytes.size(), kMaxSize));
    std::copy_n(bytes.begin(), size, data.begin());
  }
};

/// The flag bits of `can_id` in the kernel's struct can_frame, and in candump logs.
inline constexpr std::uint32_t kCanExtendedFlag = 0x80000000;
inline constexpr std::uint32_t kCanRemoteFlag = 0x40000000;
inline constexpr std::uint32_t kCanErrorFlag = 0x20000000;
inline constexpr std::uint32_t kCanStandardMask = 0x7FF;
inline constexpr std::uint32_t kCanExtendedMask = 0x1FFFFFFF;

/// The identifier with its flag bits, as in the kernel's struct can_frame.
inline std::uint32_t KernelCanId(const CanFrame& frame) {
  return frame.id.value | (frame.id.extended ? kCanExtendedFlag : 0) |
         (frame.remote ? kCanRemoteFlag : 0) | (frame.error ? kCanErrorFlag : 0);
}

/// Sets the identifier and the flags that KernelCanId gives.
inline void SetKernelCanId(CanFrame& frame, std::uint32_t can_id) {
  frame.error = (can_id & kCanErrorFlag) != 0;
  frame.remote = (can_id & kCanRemoteFlag) != 0;
  frame.id.extended = (can_id & kCanExtendedFlag) != 0;
  const bool wide = frame.id.extended || frame.error;  // error classes need more than 11 bits
  frame.id.value = can_id & (wide ? kCanExtendedMask : kCanStandardMask);
}

}  // namespace relocd
