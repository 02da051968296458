#include "camera/v4l2_output.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "camera/frame_source.h"
#include "core/file.h"

namespace relocd {
namespace {

constexpr std::uint32_t kBufferCount = 4;
constexpr std::uint32_t kBytesPerPixel = 2;  // of YUYV; a JPEG is smaller

v4l2_buffer OutputBuffer(std::uint32_t index) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.field = V4L2_FIELD_NONE;
  buffer.index = index;
  return buffer;
}

}  // namespace

Result<std::unique_ptr<V4l2Output>> V4l2Output::Open(V4l2System& system,
                                                     const std::string& device,
                                                     const V4l2OutputFormat& format) {
  const int fd = system.Open(device.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return SystemError(ErrorKind::kUnavailable, device + ": opening");
  std::unique_ptr<V4l2Output> output(new V4l2Output(system, device, fd, format));
  if (auto ok = output->CheckCapabilities(); !ok) return std::move(ok).error();
  if (auto ok = output->SetFormat(); !ok) return std::move(ok).error();
  if (auto ok = output->MapBuffers(); !ok) return std::move(ok).error();
  int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  if (auto ok = output->Call(VIDIOC_STREAMON, &type, "starting the stream"); !ok) {
    return std::move(ok).error();
  }
  return output;
}

V4l2Output::~V4l2Output() {
  int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  system_.Ioctl(fd_, VIDIOC_STREAMOFF, &type);  // where opening failed it was not on
  for (const Mapping& buffer : buffers_)
    system_.Unmap(buffer.address, buffer.size);
  system_.Close(fd_);
}

Result<void> V4l2Output::Call(unsigned long request, void* argument, std::string_view doing) {
  if (system_.Ioctl(fd_, request, argument) == 0) return {};
  return SystemError(ErrorKind::kUnavailable, fmt::format("{}: {}", path_, doing));
}

Result<void> V4l2Output::CheckCapabilities() {
  v4l2_capability capability{};
  if (system_.Ioctl(fd_, VIDIOC_QUERYCAP, &capability) != 0) {
    return SystemError(ErrorKind::kUnavailable,
                       fmt::format("{}: is no V4L2 device: asking for its capabilities", path_));
  }
  const std::uint32_t has = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                ? capability.device_caps
                                : capability.capabilities;
  constexpr std::uint32_t kNeeded = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
  if ((has & kNeeded) == kNeeded) return {};
  return Error{ErrorKind::kUnavailable,
               fmt::format("{}: has the capabilities {:#x}, must have {:#x}: output and streaming, "
                           "as a loopback device has (modprobe v4l2loopback), not a camera",
                           path_,
                           has,
                           kNeeded)};
}

Result<void> V4l2Output::SetFormat() {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  v4l2_pix_format& pix = format.fmt.pix;
  pix.width = static_cast<std::uint32_t>(format_.width);
  pix.height = static_cast<std::uint32_t>(format_.height);
  pix.pixelformat = format_.fourcc;
  pix.field = V4L2_FIELD_NONE;
  pix.bytesperline = format_.fourcc == kFourccYuyv ? pix.width * kBytesPerPixel : 0;
  pix.sizeimage = pix.width * pix.height * kBytesPerPixel;
  if (auto ok = Call(VIDIOC_S_FMT, &format, "setting the format (is it fed already?)"); !ok) {
    return ok;
  }
  const bool is_same = pix.pixelformat == format_.fourcc &&
                       static_cast<int>(pix.width) == format_.width &&
                       static_cast<int>(pix.height) == format_.height;
  if (!is_same) {
    return Error{ErrorKind::kUnavailable,
                 fmt::format("{}: takes {} of {} x {} px, must take {} of {} x {}",
                             path_,
                             FourccText(pix.pixelformat),
                             pix.width,
                             pix.height,
                             FourccText(format_.fourcc),
                             format_.width,
                             format_.height)};
  }
  constexpr std::uint32_t kDenominator = 1000;
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  parameters.parm.output.timeperframe.numerator = kDenominator;
  parameters.parm.output.timeperframe.denominator =
      static_cast<std::uint32_t>(std::lround(format_.frame_rate_hz * kDenominator));
  system_.Ioctl(fd_, VIDIOC_S_PARM, &parameters);  // readers are told; nothing depends on it
  return {};
}

Result<void> V4l2Output::MapBuffers() {
  v4l2_requestbuffers request{};
  request.count = kBufferCount;
  request.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  request.memory = V4L2_MEMORY_MMAP;
  if (auto ok = Call(VIDIOC_REQBUFS, &request, "asking for buffers"); !ok) return ok;
  if (request.count == 0) {
    return Error{ErrorKind::kUnavailable, path_ + ": asking for buffers: has none"};
  }
  for (std::uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer = OutputBuffer(i);
    if (auto ok = Call(VIDIOC_QUERYBUF, &buffer, "asking for a buffer's size"); !ok) return ok;
    void* const address = system_.Map(buffer.length, fd_, static_cast<long>(buffer.m.offset));
    if (address == MAP_FAILED) {
      return SystemError(ErrorKind::kUnavailable, path_ + ": mapping a buffer");
    }
    buffers_.push_back({address, buffer.length});
    unused_.push_back(i);
  }
  return {};
}

Result<std::uint32_t> V4l2Output::FreeBuffer() {
  if (!unused_.empty()) {
    const std::uint32_t index = unused_.front();
    unused_.pop_front();
    return index;
  }
  v4l2_buffer buffer = OutputBuffer(0);
  if (auto ok = Call(VIDIOC_DQBUF, &buffer, "taking a buffer back"); !ok) {
    return std::move(ok).error();
  }
  if (buffer.index < buffers_.size()) return buffer.index;
  return Error{ErrorKind::kUnavailable,
               fmt::format("{}: taking a buffer back: buffer {}, must be below {}",
                           path_,
                           buffer.index,
                           buffers_.size())};
}

Result<void> V4l2Output::Write(std::span<const std::uint8_t> bytes) {
  auto index = FreeBuffer();
  if (!index) return std::move(index).error();
  const Mapping& mapping = buffers_[*index];
  if (bytes.size() > mapping.size) {
    unused_.push_front(*index);
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format(
            "{}: a frame has {} bytes, must have at most {}", path_, bytes.size(), mapping.size)};
  }
  std::ranges::copy(bytes, static_cast<std::uint8_t*>(mapping.address));
  v4l2_buffer buffer = OutputBuffer(*index);
  buffer.bytesused = static_cast<std::uint32_t>(bytes.size());
  buffer.length = static_cast<std::uint32_t>(mapping.size);
  return Call(VIDIOC_QBUF, &buffer, "handing a frame over");
}

}  // namespace relocd
