#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "relocd/localization_t.hpp"

#include "core/time.h"
#include "geometry/pose3.h"
#include "messaging/image_metadata.h"
#include "messaging/latency_window.h"
#include "messaging/message_bus.h"
#include "messaging/node_status.h"
#include "relocalization/image_localizer.h"
#include "relocalization/inference_config.h"

namespace relocd {

/// An image message in, a camera pose message out: where the camera was, or why that is not known.
///
/// Borrows the bus, which must outlive it. Thread-bound.
class InferenceNode {
 public:
  using Clock = std::function<ClockReading()>;

  struct Counters {
    std::int64_t images = 0;   ///< Handled; what a newer one superseded never came here.
    std::int64_t too_old = 0;  ///< Passed over, without an answer.
    std::int64_t bad = 0;      ///< No JPEG, damaged, or without time.
    std::int64_t wrong_size = 0;
    std::int64_t no_hypothesis = 0;
    std::int64_t low_confidence = 0;
    std::int64_t degenerate = 0;
    std::int64_t off_route = 0;
    std::int64_t poses = 0;
    std::int64_t regions_tried = 0;  ///< Of the map, on all images together.
    std::int64_t priors = 0;         ///< Images for which it was known where to look first.
    std::int64_t unpublished = 0;    ///< The network refused the message.
  };

  /// @param config  valid.
  /// @param X_BCs  where each camera is on the body, by its name.
  /// @param clock  for stage times and the age of images: ReadClocks, or in a replay the time of
  /// the message, so that two replays give the same bytes.
  InferenceNode(const InferenceConfig& config,
                std::unique_ptr<ImageLocalizer> localizer,
                std::map<std::string, Pose3> X_BCs,
                MessageBus& bus,
                std::int64_t run_id,
                Clock clock);

  /// Publishes one camera_pose_t, unless the image is too old.
  ///
  /// @param camera  name in the config.
  void Handle(const std::string& camera, const image_t& image);
  /// Where the body is, from the smoother: tells in which regions of the map to look first.
  void Handle(const localization_t& localization);

  [[nodiscard]] const Counters& counters() const { return counters_; }
  [[nodiscard]] NodeStatus Status(const ClockReading& now) const;

 private:
  /// Where this camera was when the image was taken, as far as the last localization tells.
  [[nodiscard]] std::optional<CameraPrior> Prior(const std::string& camera,
                                                 MonotonicTime image_time) const;
  /// Fills in the answer. Everything about the image itself is there already.
  void Localize(const image_t& image, camera_pose_t& answer);
  void Count(const camera_pose_t& answer, MonotonicTime now);
  void RaiseLevel(const ClockReading& now, NodeStatus& status) const;

  InferenceConfig config_;
  std::unique_ptr<ImageLocalizer> localizer_;
  std::map<std::string, Pose3> X_BCs_;
  MessageBus& bus_;
  std::int64_t run_id_;
  Clock clock_;
  std::uint64_t map_seed_ = 0;  ///< From the map's id: part of the seed of each image.

  std::optional<localization_t> localization_;  ///< The last one that holds a pose.
  std::int64_t next_seq_ = 0;
  Counters counters_;
  LatencyWindow age_ms_;
  LatencyWindow work_ms_;
  std::optional<MonotonicTime> last_image_;
  std::optional<MonotonicTime> last_pose_;
  std::string last_reason_;  ///< Why the last image gave no pose; empty when it gave one.
};

}  // namespace relocd
