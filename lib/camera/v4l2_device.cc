#include "camera/v4l2_device.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "camera/frame_source.h"
#include "camera/v4l2_frame_rates.h"
#include "core/file.h"

namespace relocd {
namespace {

constexpr std::uint32_t kBufferCount = 4;
constexpr std::uint32_t kFewestBuffers = 2;  // one that is filled while the other is read

/// Whether the device is no longer there, so that only opening it again can help.
bool IsGone(int error_number) {
  return error_number == ENODEV || error_number == ENXIO || error_number == EBADF;
}

/// The formats to ask for, the wanted one first.
std::array<std::uint32_t, 3> Candidates(const std::string& wanted) {
  std::array<std::uint32_t, 3> candidates{kFourccMjpeg, kFourccYuyv, kFourccGrey};
  const auto first = std::ranges::find_if(
      candidates, [&](std::uint32_t fourcc) { return FourccText(fourcc) == wanted; });
  if (first != candidates.end()) std::rotate(candidates.begin(), first, first + 1);
  return candidates;
}

v4l2_buffer EmptyBuffer(std::size_t index) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = static_cast<std::uint32_t>(index);
  return buffer;
}

}  // namespace

Result<std::unique_ptr<V4l2Device>> V4l2Device::Open(V4l2System& system,
                                                     const CameraConfig& config) {
  const int fd = system.Open(config.device.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return SystemError(ErrorKind::kUnavailable, config.device + ": opening");
  std::unique_ptr<V4l2Device> device(new V4l2Device(system, config.device, fd));
  if (auto ok = device->CheckCapabilities(); !ok) return std::move(ok).error();
  if (auto ok = device->AgreeOnFormat(config); !ok) return std::move(ok).error();
  device->AskForFrameRate(config.frame_rate_hz);
  device->controls_ = ApplyControls(system, fd, config, device->format_.fourcc);
  if (auto ok = device->MapBuffers(); !ok) return std::move(ok).error();
  if (auto ok = device->StartStream(); !ok) return std::move(ok).error();
  return device;
}

V4l2Device::~V4l2Device() {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  system_.Ioctl(fd_, VIDIOC_STREAMOFF, &type);  // of a device that is gone this fails, rightly
  for (const Mapping& buffer : buffers_)
    system_.Unmap(buffer.address, buffer.size);
  system_.Close(fd_);
}

Result<void> V4l2Device::Call(unsigned long request, void* argument, std::string_view doing) {
  if (system_.Ioctl(fd_, request, argument) == 0) return {};
  const ErrorKind kind = IsGone(errno) ? ErrorKind::kUnavailable : ErrorKind::kInternal;
  return SystemError(kind, fmt::format("{}: {}", path_, doing));
}

Result<void> V4l2Device::CheckCapabilities() {
  v4l2_capability capability{};
  if (auto ok = Call(VIDIOC_QUERYCAP, &capability, "asking for its capabilities"); !ok) return ok;
  const std::uint32_t has = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                ? capability.device_caps
                                : capability.capabilities;
  constexpr std::uint32_t kNeeded = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  if ((has & kNeeded) == kNeeded) return {};
  return Error{ErrorKind::kUnavailable,
               fmt::format("{}: has the capabilities {:#x}, must have {:#x}: capture and streaming",
                           path_,
                           has,
                           kNeeded)};
}

Result<void> V4l2Device::AgreeOnFormat(const CameraConfig& config) {
  for (const std::uint32_t fourcc : Candidates(config.pixel_format)) {
    auto agreed = TryFormat(config, fourcc);
    if (!agreed) return std::move(agreed).error();
    if (*agreed) return {};
  }
  return Error{ErrorKind::kUnavailable,
               fmt::format("{}: gives {} at {} x {} px, must give MJPG, YUYV or GREY",
                           path_,
                           FourccText(format_.fourcc),
                           format_.width,
                           format_.height)};
}

/// The driver may answer with another format and size, and is asked again for what it really set:
/// some say one and do another.
Result<bool> V4l2Device::TryFormat(const CameraConfig& config, std::uint32_t fourcc) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = static_cast<std::uint32_t>(config.width);
  format.fmt.pix.height = static_cast<std::uint32_t>(config.height);
  format.fmt.pix.pixelformat = fourcc;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  if (system_.Ioctl(fd_, VIDIOC_S_FMT, &format) != 0) {
    if (errno == EINVAL) return false;  // not this one
    return SystemError(ErrorKind::kUnavailable, path_ + ": setting the format");
  }
  if (auto ok = Call(VIDIOC_G_FMT, &format, "reading the format"); !ok) {
    return std::move(ok).error();
  }
  const v4l2_pix_format& pix = format.fmt.pix;
  format_.fourcc = pix.pixelformat == V4L2_PIX_FMT_JPEG ? kFourccMjpeg : pix.pixelformat;
  format_.width = static_cast<int>(pix.width);
  format_.height = static_cast<int>(pix.height);
  format_.bytes_per_line = static_cast<int>(pix.bytesperline);
  const int bytes_per_pixel = format_.fourcc == kFourccYuyv ? 2 : 1;
  format_.bytes_per_line = std::max(format_.bytes_per_line, bytes_per_pixel * format_.width);
  return format_.fourcc == kFourccMjpeg || format_.fourcc == kFourccYuyv ||
         format_.fourcc == kFourccGrey;
}

void V4l2Device::AskForFrameRate(double frame_rate_hz) {
  format_.offered_rates =
      ListFrameRates(system_, fd_, format_.fourcc, format_.width, format_.height).Text();
  constexpr double kDenominator = 1000.0;
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  parameters.parm.capture.timeperframe.numerator = static_cast<std::uint32_t>(kDenominator);
  parameters.parm.capture.timeperframe.denominator =
      static_cast<std::uint32_t>(std::lround(frame_rate_hz * kDenominator));
  if (system_.Ioctl(fd_, VIDIOC_S_PARM, &parameters) != 0) return;  // a camera with one rate
  const v4l2_fract& period = parameters.parm.capture.timeperframe;
  if (period.numerator == 0 || period.denominator == 0) return;
  format_.frame_rate_hz = static_cast<double>(period.denominator) / period.numerator;
}

Result<void> V4l2Device::MapBuffers() {
  v4l2_requestbuffers request{};
  request.count = kBufferCount;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (auto ok = Call(VIDIOC_REQBUFS, &request, "asking for buffers"); !ok) return ok;
  if (request.count < kFewestBuffers) {
    return Error{ErrorKind::kUnavailable,
                 fmt::format("{}: asking for buffers: has {}, must have at least {}",
                             path_,
                             request.count,
                             kFewestBuffers)};
  }
  for (std::uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer = EmptyBuffer(i);
    if (auto ok = Call(VIDIOC_QUERYBUF, &buffer, "asking for a buffer's size"); !ok) return ok;
    void* address = system_.Map(buffer.length, fd_, static_cast<long>(buffer.m.offset));
    if (address == MAP_FAILED) {
      return SystemError(ErrorKind::kUnavailable, path_ + ": mapping a buffer");
    }
    buffers_.push_back({address, buffer.length});
  }
  return {};
}

Result<void> V4l2Device::StartStream() {
  for (std::size_t i = 0; i < buffers_.size(); ++i) {
    v4l2_buffer buffer = EmptyBuffer(i);
    if (auto ok = Call(VIDIOC_QBUF, &buffer, "queueing a buffer"); !ok) return ok;
  }
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  return Call(VIDIOC_STREAMON, &type, "starting the stream");
}

Result<void> V4l2Device::Restart() {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (auto ok = Call(VIDIOC_STREAMOFF, &type, "stopping the stream"); !ok) return ok;
  return StartStream();
}

Result<std::optional<V4l2Buffer>> V4l2Device::Dequeue() {
  v4l2_buffer buffer = EmptyBuffer(0);
  if (system_.Ioctl(fd_, VIDIOC_DQBUF, &buffer) != 0) {
    if (errno == EAGAIN) return std::optional<V4l2Buffer>();
    const ErrorKind kind = IsGone(errno) ? ErrorKind::kUnavailable : ErrorKind::kInternal;
    return SystemError(kind, path_ + ": fetching a frame");
  }
  if (buffer.index >= buffers_.size()) {
    return Error{ErrorKind::kInternal,
                 fmt::format("{}: fetching a frame: buffer {}, must be below {}",
                             path_,
                             buffer.index,
                             buffers_.size())};
  }
  const Mapping& mapping = buffers_[buffer.index];
  const std::size_t size = std::min<std::size_t>(buffer.bytesused, mapping.size);
  const auto stamp = std::chrono::seconds(buffer.timestamp.tv_sec) +
                     std::chrono::microseconds(buffer.timestamp.tv_usec);
  return std::optional(
      V4l2Buffer{.index = buffer.index,
                 .sequence = buffer.sequence,
                 .flags = buffer.flags,
                 .stamp = MonotonicTime(stamp),
                 .bytes = {static_cast<const std::uint8_t*>(mapping.address), size}});
}

Result<void> V4l2Device::Requeue(const V4l2Buffer& buffer) {
  v4l2_buffer empty = EmptyBuffer(buffer.index);
  return Call(VIDIOC_QBUF, &empty, "giving a buffer back");
}

}  // namespace relocd
