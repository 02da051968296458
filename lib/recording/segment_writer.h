#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/result.h"
#include "recording/background_sync.h"
#include "recording/log_writer.h"
#include "recording/recorder_config.h"

namespace relocd {

/// Writes events into a series of log files, and deletes the oldest of them so that the disk never
/// fills up.
///
/// A file is `relocd-<date>-<time>-<run>-<number>.lcmlog`; sorted by name they are sorted by time.
class SegmentWriter {
 public:
  /// Bytes free for this process in a folder; a test replaces it.
  using FreeSpace = std::function<Result<std::int64_t>(const std::string& directory)>;
  static Result<std::int64_t> FreeSpaceOfDisk(const std::string& directory);

  /// @param run  tells runs that start in the same second apart, of [0-9a-f].
  SegmentWriter(RecorderConfig config, std::string run, FreeSpace free_space = FreeSpaceOfDisk);

  /// Creates the folder. @return kUnavailable.
  Result<void> Open();

  /// Appends one event. An event that the disk refuses is counted as dropped; writing begins again,
  /// in a new segment, as soon as the disk takes it.
  void Append(std::int64_t timestamp_us,
              std::string_view channel,
              std::span<const std::uint8_t> data);

  /// To be called every flush_s: hands memory to the kernel, has the disk take it soon, and keeps
  /// the quota.
  void Flush();

  /// Flushes and waits for the disk. @return kUnavailable.
  Result<void> Close();

  struct Counters {
    std::int64_t events = 0;
    std::int64_t bytes = 0;
    std::int64_t dropped = 0;           ///< Events the disk refused.
    std::int64_t segments_deleted = 0;  ///< For the quota.
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }
  /// Why events are being dropped; empty while all is well.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  /// Why events were dropped the last time; empty if none ever were.
  [[nodiscard]] const std::string& last_problem() const { return last_problem_; }

 private:
  Result<void> OpenSegment(std::int64_t timestamp_us);
  void DeleteOldest();
  bool Excluded(std::string_view channel) const;
  void Drop(std::int64_t events, const Error& error);

  RecorderConfig config_;
  std::string run_;
  FreeSpace free_space_;
  std::optional<LogWriter> segment_;
  std::int64_t unsynced_events_ = 0;  ///< Taken into memory, not yet handed to the disk.
  int segment_number_ = 0;
  Counters counters_;
  std::string problem_;
  std::string last_problem_;
  std::optional<BackgroundSync>
      sync_;  ///< From Open() on. Has a thread: last, so that it ends first.
};

}  // namespace relocd
