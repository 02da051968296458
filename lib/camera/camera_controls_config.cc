#include "camera/camera_controls_config.h"

#include <limits>

#include "camera/config_checks.h"

namespace relocd {

Result<void> CameraControlsConfig::Validate() const {
  if (auto ok = CheckOneOf("exposure", exposure, "auto", "manual", "unchanged"); !ok) return ok;
  if (auto ok = CheckRange("exposure_time_ms", exposure_time_ms, 0.1, 10'000.0); !ok) return ok;
  if (auto ok = CheckRange("gain", gain, -1, std::numeric_limits<int>::max()); !ok) return ok;
  return CheckOneOf(
      "power_line_frequency", power_line_frequency, "off", "50", "60", "auto", "unchanged");
}

}  // namespace relocd
