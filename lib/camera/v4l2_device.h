#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "camera/camera_config.h"
#include "camera/v4l2_controls.h"
#include "camera/v4l2_system.h"
#include "core/result.h"
#include "core/time.h"

namespace relocd {

/// What the driver agreed to, which need not be what it was asked for.
struct V4l2Format {
  std::uint32_t fourcc = 0;
  int width = 0;               ///< px
  int height = 0;              ///< px
  int bytes_per_line = 0;      ///< Of raw formats.
  double frame_rate_hz = 0.0;  ///< 0 when the driver does not say.
  std::string offered_rates;   ///< `30, 15 Hz`; empty when it does not say.
};

/// A filled buffer, which stays the driver's and may be read until it is given back.
struct V4l2Buffer {
  std::uint32_t index = 0;
  std::uint32_t sequence = 0;  ///< The driver's count of frames, which wraps.
  std::uint32_t flags = 0;     ///< V4L2_BUF_FLAG_...
  MonotonicTime stamp{};       ///< What the driver wrote, in the clock that the flags name.
  std::span<const std::uint8_t> bytes;
};

/// An open capture device that streams into mapped buffers, from its opening to its closing.
///
/// Borrows the V4l2System, which must outlive it. Thread-bound.
class V4l2Device {
 public:
  /// Opens the device, agrees on a format among MJPG, YUYV and GREY, maps buffers, and streams.
  ///
  /// @return kUnavailable, naming device, step and what the kernel said.
  static Result<std::unique_ptr<V4l2Device>> Open(V4l2System& system, const CameraConfig& config);

  ~V4l2Device();
  V4l2Device(const V4l2Device&) = delete;
  V4l2Device& operator=(const V4l2Device&) = delete;
  V4l2Device(V4l2Device&&) = delete;
  V4l2Device& operator=(V4l2Device&&) = delete;

  /// The oldest filled buffer, or nothing when none is.
  ///
  /// @return kUnavailable when the device is gone; kInternal when restarting the stream may help.
  Result<std::optional<V4l2Buffer>> Dequeue();

  /// Gives a buffer back to be filled again; its bytes are not to be read any more.
  Result<void> Requeue(const V4l2Buffer& buffer);

  /// Stops and starts the stream with all buffers empty.
  Result<void> Restart();

  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] const V4l2Format& format() const { return format_; }
  [[nodiscard]] const V4l2ControlsReport& controls() const { return controls_; }

 private:
  struct Mapping {
    void* address = nullptr;
    std::size_t size = 0;
  };

  V4l2Device(V4l2System& system, std::string path, int fd)
      : system_(system), path_(std::move(path)), fd_(fd) {}

  Result<void> CheckCapabilities();
  Result<void> AgreeOnFormat(const CameraConfig& config);
  Result<bool> TryFormat(const CameraConfig& config, std::uint32_t fourcc);
  void AskForFrameRate(double frame_rate_hz);
  Result<void> MapBuffers();
  Result<void> StartStream();
  Result<void> Call(unsigned long request, void* argument, std::string_view doing);

  V4l2System& system_;
  std::string path_;
  int fd_;
  V4l2Format format_;
  V4l2ControlsReport controls_;
  std::vector<Mapping> buffers_;
};

}  // namespace relocd
