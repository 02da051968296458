#pragma once

#include <map>
#include <string>

#include "core/result.h"

namespace relocd {

/// What a V4L2 camera's controls are set to, each time that it is opened. The defaults leave them
/// as they are, except for the JPEG quality, which is CameraConfig's.
struct CameraControlsConfig {
  std::string exposure = "unchanged";
  double exposure_time_ms = 10.0;
  int gain = -1;
  std::string power_line_frequency = "unchanged";
  std::map<std::string, int> others;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("exposure", self.exposure, "auto, manual or unchanged");
    visit("exposure_time_ms",
          self.exposure_time_ms,
          "[0.1, 10000]; exposure manual; the images are stamped with its middle");
    visit("gain",
          self.gain,
          ">= 0 in the driver's own units, which turns the automatic one off; -1: unchanged");
    visit("power_line_frequency",
          self.power_line_frequency,
          "off, 50, 60 (Hz), auto or unchanged; against the flicker of lamps");
    visit("others",
          self.others,
          "further controls by the name that v4l2-ctl --list-ctrls gives them, set after these");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

}  // namespace relocd
