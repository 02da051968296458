#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "can/can_output.h"
#include "can/candump_log.h"
#include "core/result.h"
#include "core/time.h"

namespace relocd {

/// Plays a drive on the wall clock: CAN frames and images leave when the drive had them.
///
/// An image that is not there in time leaves late, until the next one is due; then it is dropped,
/// as a camera that is too slow drops it. Thread-bound.
class LivePlayer {
 public:
  /// The time, which a test makes up.
  struct Clock {
    std::function<MonotonicTime()> now;
    std::function<void(MonotonicTime)> sleep_until;
  };
  static Clock WallClock();

  /// Where things go; what is empty is not played.
  struct Outputs {
    std::function<Result<void>(const CanFrame&)> send_frame;
    std::function<Result<void>(const std::vector<std::uint8_t>& jpeg)> show_image;
  };

  /// What is played.
  struct Drive {
    std::vector<CandumpRecord> frames;
    std::vector<std::int64_t> image_times_ns;
    /// The JPEG of an image, or nothing while it is not there yet.
    std::function<Result<std::optional<std::vector<std::uint8_t>>>(std::size_t)> image;
  };

  struct Counters {
    std::int64_t frames = 0;
    std::int64_t images = 0;
    std::int64_t late_frames = 0;  ///< By more than kLate, among those sent.
    std::int64_t late_images = 0;
    std::int64_t dropped_images = 0;
    Duration worst_frame{};  ///< Lateness.
    Duration worst_image{};
  };
  static constexpr Duration kLate = std::chrono::milliseconds(10);

  LivePlayer(Drive drive, Outputs outputs, Clock clock)
      : drive_(std::move(drive)), outputs_(std::move(outputs)), clock_(std::move(clock)) {}

  /// Plays all of it. The drive's time 0 is at `epoch`; what was due before now is late.
  ///
  /// @param stop  ends it early once it is true.
  /// @return the first error of an output.
  Result<void> Play(MonotonicTime epoch, const std::atomic<bool>& stop);

  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  [[nodiscard]] MonotonicTime NextWakeUp(MonotonicTime now) const;
  Result<void> SendFrames(MonotonicTime now);
  Result<void> ShowImage(MonotonicTime now);
  [[nodiscard]] MonotonicTime ImageDue(std::size_t image) const;

  Drive drive_;
  Outputs outputs_;
  Clock clock_;
  MonotonicTime epoch_{};
  std::size_t next_frame_ = 0;
  std::size_t next_image_ = 0;
  Counters counters_;
};

}  // namespace relocd
