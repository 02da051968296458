#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "relocd/image_t.hpp"

#include "camera/camera_config.h"
#include "camera/frame_source.h"
#include "core/time.h"
#include "messaging/message_bus.h"
#include "messaging/node_status.h"

namespace relocd {

/// Publishes a source's frames as IMAGE_<camera>.
///
/// Borrows the source and the bus, which must outlive it. Thread-bound.
class CameraNode {
 public:
  /// Above this many bytes an image takes more than one datagram, and a lost one loses it.
  static constexpr std::size_t kOneDatagramBytes = 65'400;

  /// @param camera  its name, of letters, digits and _.
  /// @param bus  the image network.
  CameraNode(const std::string& camera,
             const CameraConfig& config,
             FrameSource& source,
             MessageBus& bus,
             std::int64_t run_id);

  /// Publishes the oldest frame that waits. To be called whenever the source asks for it: one at a
  /// time, so that a camera that gives frames faster than they are encoded does not keep the loop,
  /// and each is stamped by the time it was fetched at.
  void HandleSource(const ClockReading& now);

  [[nodiscard]] NodeStatus Status(const ClockReading& now) const;

  /// What to log since the last call: the source's notices, and the first image that was too large.
  std::vector<std::string> TakeNotices();

 private:
  void Publish(Frame frame, const ClockReading& now);

  Channel<image_t> channel_;
  CameraConfig config_;
  FrameSource& source_;
  MessageBus& bus_;
  std::int64_t run_id_;
  std::int64_t seq_ = 0;
  std::int64_t oversize_ = 0;
  std::int64_t publish_failures_ = 0;
  std::string publish_error_;  ///< Of the last image; empty when it went out.
  int width_ = 0;              ///< px, of the last image.
  int height_ = 0;             ///< px
  std::size_t image_bytes_ = 0;
  Duration age_{};                       ///< Of the last image when it was published.
  std::deque<MonotonicTime> published_;  ///< When the last ones were, for the rate.
  std::vector<std::string> notices_;
};

}  // namespace relocd
