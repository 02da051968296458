#pragma once

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cmath>
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

/// A control of a FakeV4l2.
struct FakeControl {
  std::uint32_t id = 0;
  std::string name;
  std::int32_t minimum = 0;
  std::int32_t maximum = 255;
  std::int32_t step = 1;
  std::int32_t value = 0;
  std::vector<std::int32_t> menu = {};  ///< The choices that it offers.
  int set_error = 0;                    ///< errno of VIDIOC_S_CTRL.
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
  std::vector<v4l2_fract> frame_periods;  ///< That it lists; it takes the nearest of them.
  bool lists_a_range = false;             ///< From the first to the last of frame_periods.
  std::vector<FakeControl> controls;
  bool restarts = true;  ///< Whether VIDIOC_STREAMOFF and VIDIOC_STREAMON work.

  /// Frames that wait to be fetched.
  std::deque<FakeFrame> frames;

  // What was done to it.
  std::vector<std::string> calls;  ///< Of the ioctls; those of queueing with their buffer.
  int open_fds = 0;
  int mapped = 0;
  int opened = 0;

  void Unplug() { plugged_in = false; }
  [[nodiscard]] std::int32_t ValueOf(std::uint32_t id) const {
    return std::ranges::find(controls, id, &FakeControl::id)->value;
  }
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
      case VIDIOC_ENUM_FMT:
        return ListFormat(*static_cast<v4l2_fmtdesc*>(argument));
      case VIDIOC_S_PARM:
        return SetPeriod(static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe);
      case VIDIOC_ENUM_FRAMEINTERVALS:
        return ListPeriod(*static_cast<v4l2_frmivalenum*>(argument));
      default:
        return ControlIoctl(request, argument);
    }
  }

 private:
  static constexpr int kFirstFd = 1000;

  static int Fail(int error) {
    errno = error;
    return -1;
  }

  int ControlIoctl(unsigned long request, void* argument) {
    switch (request) {
      case VIDIOC_QUERYCTRL:
        return QueryControl(*static_cast<v4l2_queryctrl*>(argument));
      case VIDIOC_QUERYMENU:
        return QueryMenu(*static_cast<v4l2_querymenu*>(argument));
      case VIDIOC_G_CTRL:
        return GetControl(*static_cast<v4l2_control*>(argument));
      case VIDIOC_S_CTRL:
        return SetControl(*static_cast<v4l2_control*>(argument));
      default:
        return StreamingIoctl(request, argument);
    }
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

  int ListFormat(v4l2_fmtdesc& format) const {
    if (format.index >= formats.size()) return Fail(EINVAL);
    format.pixelformat = formats[format.index];
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

  FakeControl* FindControl(std::uint32_t id) {
    const auto found = std::ranges::find(controls, id, &FakeControl::id);
    return found == controls.end() ? nullptr : &*found;
  }

  /// As the kernel: controls are in the order of their ids.
  int QueryControl(v4l2_queryctrl& query) {
    const std::uint32_t id = query.id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
    const FakeControl* found = FindControl(id);
    if ((query.id & V4L2_CTRL_FLAG_NEXT_CTRL) != 0) {
      std::ranges::sort(controls, {}, &FakeControl::id);
      const auto next = std::ranges::upper_bound(controls, id, {}, &FakeControl::id);
      found = next == controls.end() ? nullptr : &*next;
    }
    if (found == nullptr) return Fail(EINVAL);
    query = v4l2_queryctrl{};
    query.id = found->id;
    query.type = found->menu.empty() ? V4L2_CTRL_TYPE_INTEGER : V4L2_CTRL_TYPE_MENU;
    found->name.copy(reinterpret_cast<char*>(query.name), sizeof(query.name) - 1);
    query.minimum = found->minimum;
    query.maximum = found->maximum;
    query.step = found->step;
    return 0;
  }

  int QueryMenu(const v4l2_querymenu& query) {
    const FakeControl* control = FindControl(query.id);
    if (control == nullptr) return Fail(EINVAL);
    const auto choice = static_cast<std::int32_t>(query.index);
    return std::ranges::count(control->menu, choice) > 0 ? 0 : Fail(EINVAL);
  }

  int GetControl(v4l2_control& wanted) {
    const FakeControl* control = FindControl(wanted.id);
    if (control == nullptr) return Fail(EINVAL);
    wanted.value = control->value;
    return 0;
  }

  int SetControl(const v4l2_control& wanted) {
    calls.emplace_back("control");
    FakeControl* control = FindControl(wanted.id);
    if (control == nullptr) return Fail(EINVAL);
    if (control->set_error != 0) return Fail(control->set_error);
    control->value = wanted.value;
    return 0;
  }

  int SetPeriod(v4l2_fract& period) const {
    if (!has_frame_rate) return Fail(ENOTTY);
    if (frame_periods.empty()) return 0;
    const double wanted_s = Seconds(period);
    period = *std::ranges::min_element(frame_periods, {}, [&](const v4l2_fract& offered) {
      return std::abs(Seconds(offered) - wanted_s);
    });
    return 0;
  }

  int ListPeriod(v4l2_frmivalenum& interval) const {
    if (interval.index >= frame_periods.size()) return Fail(EINVAL);
    if (lists_a_range) {
      interval.type = V4L2_FRMIVAL_TYPE_STEPWISE;
      interval.stepwise.min = frame_periods.front();
      interval.stepwise.max = frame_periods.back();
    } else {
      interval.type = V4L2_FRMIVAL_TYPE_DISCRETE;
      interval.discrete = frame_periods[interval.index];
    }
    return 0;
  }

  static double Seconds(const v4l2_fract& period) {
    return static_cast<double>(period.numerator) / period.denominator;
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
