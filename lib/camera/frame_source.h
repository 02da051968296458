#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "core/time.h"

namespace relocd {

/// Bits of Frame::flags, and of an image message's metadata `flags`.
enum FrameFlag : std::int32_t {
  kFrameTimeOfReceipt = 1,  ///< The driver gave no usable time: stamped when it was fetched.
  kFrameAfterGap = 2,       ///< Frames between the one before and this one were lost.
};

/// The four characters of a V4L2 pixel format as a number.
constexpr std::uint32_t Fourcc(char a, char b, char c, char d) {
  return static_cast<std::uint32_t>(static_cast<unsigned char>(a)) |
         static_cast<std::uint32_t>(static_cast<unsigned char>(b)) << 8U |
         static_cast<std::uint32_t>(static_cast<unsigned char>(c)) << 16U |
         static_cast<std::uint32_t>(static_cast<unsigned char>(d)) << 24U;
}
inline constexpr std::uint32_t kFourccMjpeg = Fourcc('M', 'J', 'P', 'G');
inline constexpr std::uint32_t kFourccYuyv = Fourcc('Y', 'U', 'Y', 'V');
inline constexpr std::uint32_t kFourccGrey = Fourcc('G', 'R', 'E', 'Y');

/// `MJPG` for 0x47504a4d; unprintable characters as dots.
std::string FourccText(std::uint32_t fourcc);

/// One image of a camera, as it is published.
struct Frame {
  std::vector<std::uint8_t> bytes;  ///< For MJPEG one whole JPEG.
  std::uint32_t fourcc = kFourccMjpeg;
  int width = 0;                  ///< px
  int height = 0;                 ///< px
  int bytes_per_line = 0;         ///< Of raw formats; 0 for MJPEG.
  MonotonicTime time{};           ///< The middle of the exposure.
  std::int64_t sequence = 0;      ///< The driver's count, or the index in a recording.
  std::int32_t flags = 0;         ///< Bits of FrameFlag.
  std::int32_t exposure_us = -1;  ///< -1 when unknown.
};

/// What a source has seen since it was made.
struct FrameCounters {
  std::int64_t delivered = 0;
  std::int64_t dropped = 0;  ///< Lost before they could be fetched: gaps in the driver's sequence,
                             ///< frames of a recording that were due too long ago.
  std::int64_t damaged = 0;  ///< Fetched, but not whole: marked by the driver, no JPEG, unreadable.
  std::int64_t stalls = 0;   ///< Times the stream was restarted since no frame came.
  std::int64_t reopened = 0;  ///< Times the device was found again after it had been lost.
};

/// Where images come from: a camera, or a recording. It never waits: its user does, for `fd()` to
/// be readable or for `NextWakeUp()`, and then calls Next.
///
/// Thread-bound.
class FrameSource {
 public:
  FrameSource() = default;
  virtual ~FrameSource() = default;
  FrameSource(const FrameSource&) = delete;
  FrameSource& operator=(const FrameSource&) = delete;
  FrameSource(FrameSource&&) = delete;
  FrameSource& operator=(FrameSource&&) = delete;

  /// To be called once. A camera that is not there yet is no error: it is looked for again.
  ///
  /// @return kInvalidInput when there can never be a frame.
  virtual Result<void> Start(MonotonicTime now) = 0;

  /// To be watched for readability; -1 when there is nothing to watch. Another one after each Next.
  [[nodiscard]] virtual int fd() const = 0;

  /// When to call Next although `fd()` is not readable; MonotonicTime::max() for never.
  [[nodiscard]] virtual MonotonicTime NextWakeUp() const = 0;

  /// The oldest frame that waits, or nothing when none does. Mends what it finds broken.
  virtual std::optional<Frame> Next(MonotonicTime now) = 0;

  /// Whether a recording is over: no frame will come any more.
  [[nodiscard]] virtual bool ended() const { return false; }

  [[nodiscard]] const FrameCounters& counters() const { return counters_; }

  /// Why no frames come; empty while they do.
  [[nodiscard]] const std::string& problem() const { return problem_; }

  /// What is otherwise than the config asks, although frames come; empty when nothing is.
  [[nodiscard]] const std::string& remark() const { return remark_; }

  /// What an operator should read of since the last call, besides the problem: a camera found
  /// again, a file that is damaged. Each change once, not each event.
  std::vector<std::string> TakeNotices() { return std::exchange(notices_, {}); }

 protected:
  FrameCounters counters_;
  std::string problem_;
  std::string remark_;
  std::vector<std::string> notices_;
};

}  // namespace relocd
