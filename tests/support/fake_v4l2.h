#pragma once

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "camera/v4l2_system.h"
#include "core/time.h"

namespace relocd {

/// What a FakeV4l2 puts into the next free buffer, or the error that it gives in its place.
struct FakeFrame {
  std::vector<std::uint8_t> bytes;
  std::uint32_t sequence = 0;
  MonotonicTime stamp{};
  std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  int error = 0;  ///< errno of VIDIOC_DQBUF; 0 for a frame.
};

/// A camera and its driver, in a test's hands. A buffer that is given back is scribbled over at
/// once, so that whoever still reads it is found out.
class FakeV4l2 final : public V4l2System {
 public:
  static constexpr std::size_t kBufferSize = 64 << 10;

  // What the camera is like.
  bool plugged_in = true;
  int open_error = ENOENT;  ///< While it is not plugged in.
  std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  std::vector<std::uint32_t> formats{V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_GREY};
  bool refuses_other_formats = true;    ///< Else it answers with its first one.
  std::array<std::uint32_t, 2> size{};  ///< What it makes of any size, unless 0.
  std::uint32_t extra_bytes_per_line = 0;
  std::uint32_t granted_buffers = 4;
  bool has_frame_rate = true;
  int manual_exposure = -1;  ///< In units of 100 us, or -1 for automatic.
  bool restarts = true;      ///< Whether VIDIOC_STREAMOFF and VIDIOC_STREAMON work.

  /// Frames that wait to be fetched.
  std::deque<FakeFrame> frames;

  // What was done to it.
  std::vector<std::string> calls;  ///< Of the ioctls; those of queueing with their buffer.
  int open_fds = 0;
  int mapped = 0;
  int opened = 0;

  void Unplug() { plugged_in = false; }
  [[nodiscard]] int Count(const std::string& call) const {
    return static_cast<int>(std::ranges::count(calls, call));
  }
  [[nodiscard]] std::size_t queued() const { return queued_.size(); }

  int Open(const char* /*path*/, int flags) override {
    if ((flags & O_NONBLOCK) == 0 || !plugged_in) return Fail(open_error);
    ++open_fds;
    ++opened;
    alive_ = true;
    return kFirstFd + opened;
  }
  int Close(int /*fd*/) override {
    --open_fds;
    return 0;
  }
  void* Map(std::size_t /*length*/, int /*fd*/, long offset) override {
    ++mapped;
    return memory_.at(static_cast<std::size_t>(offset)).data();
  }
  int Unmap(void* /*address*/, std::size_t /*length*/) override {
    --mapped;
    return 0;
  }
  int Ioctl(int fd, unsigned long request, void* argument) override {
    alive_ = alive_ && plugged_in;
    if (!alive_ || fd != kFirstFd + opened) return Fail(ENODEV);
    switch (request) {
      case VIDIOC_QUERYCAP:
        return QueryCapabilities(*static_cast<v4l2_capability*>(argument));
      case VIDIOC_S_FMT:
        return SetFormat(*static_cast<v4l2_format*>(argument));
      case VIDIOC_G_FMT:
        *static_cast<v4l2_format*>(argument) = format_;
        return 0;
      case VIDIOC_S_PARM:
        return has_frame_rate ? 0 : Fail(ENOTTY);
      case VIDIOC_G_CTRL:
        return GetControl(*static_cast<v4l2_control*>(argument));
      case VIDIOC_S_CTRL:
        return Fail(EINVAL);
      default:
        return StreamingIoctl(request, argument);
    }
  }

 private:
  static constexpr int kFirstFd = 1000;

  static int Fail(int error) {
    errno = error;
    return -1;
  }

  int StreamingIoctl(unsigned long request, void* argument) {
    switch (request) {
      case VIDIOC_REQBUFS:
        return RequestBuffers(*static_cast<v4l2_requestbuffers*>(argument));
      case VIDIOC_QUERYBUF:
        return QueryBuffer(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_QBUF:
        return Queue(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_DQBUF:
        return Dequeue(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_STREAMON:
        calls.emplace_back("on");
        streaming_ = true;
        return 0;
      case VIDIOC_STREAMOFF:
        calls.emplace_back("off");
        if (!restarts) return Fail(EIO);
        streaming_ = false;
        queued_.clear();
        return 0;
      default:
        return Fail(ENOTTY);
    }
  }

  int QueryCapabilities(v4l2_capability& capability) const {
    capability.capabilities = capabilities | V4L2_CAP_DEVICE_CAPS;
    capability.device_caps = capabilities;
    return 0;
  }

  int SetFormat(v4l2_format& format) {
    calls.emplace_back("format");
    v4l2_pix_format& pix = format.fmt.pix;
    if (std::ranges::find(formats, pix.pixelformat) == formats.end()) {
      if (refuses_other_formats) return Fail(EINVAL);
      pix.pixelformat = formats.front();
    }
    if (size[0] != 0) pix.width = size[0];
    if (size[1] != 0) pix.height = size[1];
    const std::uint32_t bytes_per_pixel = pix.pixelformat == V4L2_PIX_FMT_YUYV ? 2 : 1;
    pix.bytesperline = pix.pixelformat == V4L2_PIX_FMT_MJPEG
                           ? 0
                           : pix.width * bytes_per_pixel + extra_bytes_per_line;
    format_ = format;
    return 0;
  }

  int GetControl(v4l2_control& control) const {
    if (control.id == V4L2_CID_EXPOSURE_AUTO) {
      control.value = manual_exposure < 0 ? V4L2_EXPOSURE_AUTO : V4L2_EXPOSURE_MANUAL;
      return 0;
    }
    if (control.id != V4L2_CID_EXPOSURE_ABSOLUTE) return Fail(EINVAL);
    control.value = manual_exposure;
    return 0;
  }

  int RequestBuffers(v4l2_requestbuffers& request) {
    request.count = std::min(request.count, granted_buffers);
    memory_.assign(request.count, std::vector<std::uint8_t>(kBufferSize));
    queued_.clear();
    return 0;
  }

  static int QueryBuffer(v4l2_buffer& buffer) {
    buffer.length = kBufferSize;
    buffer.m.offset = buffer.index;
    return 0;
  }

  int Queue(v4l2_buffer& buffer) {
    calls.push_back("queue " + std::to_string(buffer.index));
    constexpr std::uint8_t kScribble = 0xEE;
    std::ranges::fill(memory_.at(buffer.index), kScribble);
    queued_.push_back(buffer.index);
    return 0;
  }

  int Dequeue(v4l2_buffer& buffer) {
    if (!streaming_) return Fail(EINVAL);
    if (frames.empty()) return Fail(EAGAIN);
    if (frames.front().error != 0) {
      const int error = frames.front().error;
      frames.pop_front();
      return Fail(error);
    }
    if (queued_.empty()) return Fail(EAGAIN);
    const FakeFrame frame = std::move(frames.front());
    frames.pop_front();
    buffer.index = queued_.front();
    queued_.pop_front();
    calls.push_back("dequeue " + std::to_string(buffer.index));
    std::ranges::copy(frame.bytes, memory_.at(buffer.index).begin());
    buffer.bytesused = static_cast<std::uint32_t>(frame.bytes.size());
    buffer.sequence = frame.sequence;
    buffer.flags = frame.flags;
    const auto us = ToNanoseconds(frame.stamp) / 1000;
    buffer.timestamp.tv_sec = us / 1'000'000;
    buffer.timestamp.tv_usec = us % 1'000'000;
    return 0;
  }

  v4l2_format format_{};
  std::vector<std::vector<std::uint8_t>> memory_;
  std::deque<std::uint32_t> queued_;
  bool streaming_ = false;
  bool alive_ = false;  ///< The opened node still leads to the camera.
};

}  // namespace relocd
