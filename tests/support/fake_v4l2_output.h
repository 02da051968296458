#pragma once

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <cstdint>
#include <deque>
#include <vector>

#include "camera/v4l2_system.h"

namespace relocd {

/// A loopback device and its driver, in a test's hands: keeps what it is fed with.
class FakeV4l2Output final : public V4l2System {
 public:
  static constexpr std::size_t kBufferSize = 64 << 10;

  // What the device is like.
  int open_error = 0;  ///< errno of opening it.
  std::uint32_t capabilities = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
  bool is_v4l2 = true;
  bool is_fed_already = false;
  std::uint32_t only_format = 0;  ///< What it makes of any other, unless 0.
  int queue_error = 0;            ///< errno of VIDIOC_QBUF.

  // What was done to it.
  std::vector<std::vector<std::uint8_t>> frames;
  v4l2_pix_format format{};
  bool is_streaming = false;
  int open_fds = 0;
  int mapped = 0;

  int Open(const char* /*path*/, int /*flags*/) override {
    if (open_error != 0) return Fail(open_error);
    ++open_fds;
    return kFd;
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
  int Ioctl(int /*fd*/, unsigned long request, void* argument) override {
    if (!is_v4l2) return Fail(ENOTTY);
    switch (request) {
      case VIDIOC_QUERYCAP:
        static_cast<v4l2_capability*>(argument)->capabilities = capabilities;
        return 0;
      case VIDIOC_S_FMT:
        return SetFormat(*static_cast<v4l2_format*>(argument));
      case VIDIOC_S_PARM:
        return 0;
      case VIDIOC_STREAMON:
        is_streaming = true;
        return 0;
      case VIDIOC_STREAMOFF:
        is_streaming = false;
        return 0;
      case VIDIOC_REQBUFS:
        memory_.assign(static_cast<v4l2_requestbuffers*>(argument)->count,
                       std::vector<std::uint8_t>(kBufferSize));
        return 0;
      default:
        return BufferIoctl(request, *static_cast<v4l2_buffer*>(argument));
    }
  }

 private:
  static constexpr int kFd = 1000;

  static int Fail(int error) {
    errno = error;
    return -1;
  }

  int SetFormat(v4l2_format& wanted) {
    if (is_fed_already || wanted.type != V4L2_BUF_TYPE_VIDEO_OUTPUT) return Fail(EINVAL);
    if (only_format != 0) wanted.fmt.pix.pixelformat = only_format;
    format = wanted.fmt.pix;
    return 0;
  }

  int BufferIoctl(unsigned long request, v4l2_buffer& buffer) {
    if (request == VIDIOC_QUERYBUF) {
      buffer.length = kBufferSize;
      buffer.m.offset = buffer.index;
      return 0;
    }
    if (request == VIDIOC_DQBUF) {
      if (queued_.empty()) return Fail(EAGAIN);
      buffer.index = queued_.front();
      queued_.pop_front();
      return 0;
    }
    if (request != VIDIOC_QBUF) return Fail(ENOTTY);
    if (queue_error != 0) return Fail(queue_error);
    const std::vector<std::uint8_t>& memory = memory_.at(buffer.index);
    frames.emplace_back(memory.begin(), memory.begin() + buffer.bytesused);
    queued_.push_back(buffer.index);
    return 0;
  }

  std::vector<std::vector<std::uint8_t>> memory_;
  std::deque<std::uint32_t> queued_;
};

}  // namespace relocd
