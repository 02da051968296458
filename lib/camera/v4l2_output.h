#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "camera/v4l2_system.h"
#include "core/result.h"

namespace relocd {

/// What an output device is to be fed with.
struct V4l2OutputFormat {
  std::uint32_t fourcc = 0;  ///< kFourccMjpeg or kFourccYuyv.
  int width = 0;             ///< px
  int height = 0;            ///< px
  double frame_rate_hz = 30.0;
};

/// A V4L2 output device, such as v4l2loopback's, from which programs then read as from a camera.
///
/// It is fed through mapped buffers: after write(), v4l2loopback 0.12.7 refuses the next feeder.
///
/// Borrows the V4l2System, which must outlive it. Thread-bound.
class V4l2Output {
 public:
  /// @return kUnavailable, naming device, step and what the kernel said; also for a device that is
  ///         none for output, or takes another format.
  static Result<std::unique_ptr<V4l2Output>> Open(V4l2System& system,
                                                  const std::string& device,
                                                  const V4l2OutputFormat& format);

  ~V4l2Output();
  V4l2Output(const V4l2Output&) = delete;
  V4l2Output& operator=(const V4l2Output&) = delete;
  V4l2Output(V4l2Output&&) = delete;
  V4l2Output& operator=(V4l2Output&&) = delete;

  /// Hands a frame over, which readers see as of now.
  ///
  /// @return kInvalidInput for one that is larger than the device's buffers; kUnavailable when the
  ///         device does not take it.
  Result<void> Write(std::span<const std::uint8_t> bytes);

  [[nodiscard]] const V4l2OutputFormat& format() const { return format_; }

 private:
  struct Mapping {
    void* address = nullptr;
    std::size_t size = 0;
  };

  V4l2Output(V4l2System& system, std::string path, int fd, const V4l2OutputFormat& format)
      : system_(system), path_(std::move(path)), fd_(fd), format_(format) {}

  Result<void> CheckCapabilities();
  Result<void> SetFormat();
  Result<void> MapBuffers();
  Result<std::uint32_t> FreeBuffer();
  Result<void> Call(unsigned long request, void* argument, std::string_view doing);

  V4l2System& system_;
  std::string path_;
  int fd_;
  V4l2OutputFormat format_;
  std::vector<Mapping> buffers_;
  std::deque<std::uint32_t> unused_;  ///< Buffers that were not handed over yet.
};

}  // namespace relocd
