#include "camera/v4l2_frame_rates.h"

#include <linux/videodev2.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace relocd {
namespace {

/// 0 for a period that is none.
double RateOf(const v4l2_fract& period) {
  return period.numerator == 0 ? 0.0 : static_cast<double>(period.denominator) / period.numerator;
}

}  // namespace

std::string V4l2FrameRates::Text() const {
  if (highest_hz > 0.0) return fmt::format("{:.4g} to {:.4g} Hz", lowest_hz, highest_hz);
  if (discrete_hz.empty()) return "";
  return fmt::format("{:.4g} Hz", fmt::join(discrete_hz, ", "));
}

V4l2FrameRates ListFrameRates(
    V4l2System& system, int fd, std::uint32_t fourcc, int width, int height) {
  constexpr std::uint32_t kMost = 100;  // a driver that never ends must not hold us
  V4l2FrameRates rates;
  v4l2_frmivalenum interval{};
  interval.pixel_format = fourcc;
  interval.width = static_cast<std::uint32_t>(width);
  interval.height = static_cast<std::uint32_t>(height);
  while (interval.index < kMost && system.Ioctl(fd, VIDIOC_ENUM_FRAMEINTERVALS, &interval) == 0) {
    if (interval.type != V4L2_FRMIVAL_TYPE_DISCRETE) {
      rates.lowest_hz = RateOf(interval.stepwise.max);
      rates.highest_hz = RateOf(interval.stepwise.min);
      return rates;
    }
    rates.discrete_hz.push_back(RateOf(interval.discrete));
    ++interval.index;
  }
  return rates;
}

}  // namespace relocd
