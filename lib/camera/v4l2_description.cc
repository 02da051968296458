#include "camera/v4l2_description.h"

#include <fcntl.h>
#include <linux/videodev2.h>

#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "camera/frame_source.h"
#include "camera/v4l2_controls.h"
#include "camera/v4l2_frame_rates.h"
#include "core/file.h"

namespace relocd {
namespace {

/// The pixel formats that the driver lists, those included that camerad cannot use.
std::vector<std::uint32_t> ListFormats(V4l2System& system, int fd) {
  constexpr std::uint32_t kMost = 100;  // a driver that never ends must not hold us
  std::vector<std::uint32_t> formats;
  v4l2_fmtdesc format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  for (; format.index < kMost && system.Ioctl(fd, VIDIOC_ENUM_FMT, &format) == 0; ++format.index)
    formats.push_back(format.pixelformat);
  return formats;
}

std::string Describe(V4l2System& system, int fd, const CameraConfig& config) {
  std::vector<std::string> parts;
  for (const std::uint32_t fourcc : ListFormats(system, fd)) {
    const std::string rates =
        ListFrameRates(system, fd, fourcc, config.width, config.height).Text();
    parts.push_back(
        rates.empty()
            ? FourccText(fourcc)
            : fmt::format(
                  "{} {} x {} px at {}", FourccText(fourcc), config.width, config.height, rates));
  }
  if (parts.empty()) parts.emplace_back("no pixel format listed");
  const auto controls = ListControls(system, fd);
  parts.push_back(controls.empty() ? "no controls"
                                   : fmt::format("controls: {}", fmt::join(controls, ", ")));
  return fmt::format("{}", fmt::join(parts, "; "));
}

}  // namespace

Result<std::string> DescribeCamera(V4l2System& system, const CameraConfig& config) {
  const int fd = system.Open(config.device.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return SystemError(ErrorKind::kUnavailable, config.device + ": opening");
  std::string text = Describe(system, fd, config);
  system.Close(fd);
  return text;
}

}  // namespace relocd
