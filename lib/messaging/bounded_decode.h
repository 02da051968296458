#pragma once

#include <cstdint>
#include <exception>
#include <optional>
#include <span>

#include "relocd/camera_pose_t.hpp"
#include "relocd/can_frames_t.hpp"
#include "relocd/config_t.hpp"
#include "relocd/image_t.hpp"
#include "relocd/localization_t.hpp"
#include "relocd/odometry_t.hpp"
#include "relocd/status_t.hpp"
#include "relocd/supervisor_t.hpp"
#include "relocd/text_t.hpp"

#include "messaging/wire_walker.h"

namespace relocd {

/// The most that a message may hold. More is refused before anything is allocated for it.
struct MessageLimits {
  static constexpr std::int32_t kImageBytes = 16 << 20;
  static constexpr std::int32_t kImageMetadata = 32;
  static constexpr std::int32_t kNameCharacters = 256;
  static constexpr std::int32_t kTextCharacters = 4096;
  static constexpr std::int32_t kConfigCharacters = 1 << 20;
  static constexpr std::int32_t kCanFrames = 4096;
  static constexpr std::int32_t kCanBytes = 64;
  static constexpr std::int32_t kWheels = 16;
  static constexpr std::int32_t kStatusValues = 256;
  static constexpr std::int32_t kProcesses = 256;
};

/// Walks over a message's fields behind its fingerprint; one overload for each type whose size
/// varies.
bool WalkFields(WireWalker& walker, const camera_pose_t* type);
bool WalkFields(WireWalker& walker, const can_frames_t* type);
bool WalkFields(WireWalker& walker, const config_t* type);
bool WalkFields(WireWalker& walker, const image_t* type);
bool WalkFields(WireWalker& walker, const localization_t* type);
bool WalkFields(WireWalker& walker, const odometry_t* type);
bool WalkFields(WireWalker& walker, const status_t* type);
bool WalkFields(WireWalker& walker, const supervisor_t* type);
bool WalkFields(WireWalker& walker, const text_t* type);

/// Whether `bytes` have the shape of a Message: its fields within the limits, and nothing behind
/// them.
template <typename Message>
bool HasShapeOf(std::span<const std::uint8_t> bytes) {
  if constexpr (requires(WireWalker & walker, const Message* type) { WalkFields(walker, type); }) {
    constexpr std::size_t kFingerprintSize = 8;
    WireWalker walker(bytes);
    const Message* const type = nullptr;
    return walker.Skip(kFingerprintSize) && WalkFields(walker, type) && walker.AtEnd();
  } else {
    return static_cast<int>(bytes.size()) == Message().getEncodedSize();
  }
}

/// The message that the whole of `bytes` encodes, or nothing. Never throws, and allocates no more
/// than the limits allow.
template <typename Message>
std::optional<Message> DecodeBounded(std::span<const std::uint8_t> bytes) noexcept {
  try {
    if (!HasShapeOf<Message>(bytes)) return std::nullopt;
    const int size = static_cast<int>(bytes.size());
    std::optional<Message> message(std::in_place);
    if (message->decode(bytes.data(), 0, size) != size) return std::nullopt;
    return message;
  } catch (const std::exception&) {  // out of memory
    return std::nullopt;
  }
}

}  // namespace relocd
