#pragma once

#include <string>

#include "core/result.h"
#include "relocalization/camera_pose_estimator.h"

namespace relocd {

/// How images become camera poses.
struct InferenceConfig {
  std::string map_path{};
  int threads = 1;
  int regions_per_image = 3;
  int max_image_age_ms = 500;
  CameraPoseOptions pose;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("map_path", self.map_path, "the map, made by `reloc map train`");
    visit("threads",
          self.threads,
          "in [1, 64]; of the network; they wait for each other actively, so no more than cores "
          "are free");
    visit("regions_per_image",
          self.regions_per_image,
          "in [2, 1000]; regions of the map that are tried on an image at most; 7 ms each on one "
          "thread");
    visit("max_image_age_ms",
          self.max_image_age_ms,
          "in [0, 60000]; older images are passed over, and counted; 0: none is too old, as when "
          "lcm-logplayer plays an old log");
    visit("pose", self.pose, "The search for the pose in the scene coordinates.");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

}  // namespace relocd
