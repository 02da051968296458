#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "camera/v4l2_system.h"

namespace relocd {

/// The frame rates that a driver says it can give of one format and size.
struct V4l2FrameRates {
  std::vector<double> discrete_hz;  ///< Falling, as most drivers list them.
  double lowest_hz = 0.0;           ///< Of a range; 0 without one.
  double highest_hz = 0.0;

  /// `30, 25, 15 Hz`, `1 to 60 Hz`, or nothing when the driver does not say.
  [[nodiscard]] std::string Text() const;
};

/// Asks an open device; one that lists nothing has one rate, or does not know.
V4l2FrameRates ListFrameRates(
    V4l2System& system, int fd, std::uint32_t fourcc, int width, int height);

}  // namespace relocd
