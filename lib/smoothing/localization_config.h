#pragma once

#include <string>

#include "core/result.h"
#include "smoothing/smoother_config.h"

namespace relocd {

/// How odometry and camera poses become the vehicle's pose, and how that survives a restart.
struct LocalizationConfig {
  std::string state_file = "/run/relocd/smootherd.state";
  double state_period_s = 2.0;
  double state_max_age_s = 300.0;
  double max_speed_mps = 3.0;
  double max_yaw_rate_radps = 1.5;
  SmootherConfig smoother;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("state_file",
          self.state_file,
          "where the pose is kept for the next start; empty for nowhere. /run is emptied by a "
          "reboot, after which the pose would not be used anyhow");
    visit("state_period_s", self.state_period_s, "[0.1, 3600]; how often it is written");
    visit("state_max_age_s", self.state_max_age_s, "> 0; an older one is not used");
    visit("max_speed_mps",
          self.max_speed_mps,
          "> 0; how fast the body may have moved while there was no odometry");
    visit("max_yaw_rate_radps", self.max_yaw_rate_radps, "> 0; the same for turning");
    visit("smoother", self.smoother, "The window of poses that odometry and fixes are put into.");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

}  // namespace relocd
