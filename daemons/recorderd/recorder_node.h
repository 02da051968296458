#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "core/time.h"
#include "messaging/node_status.h"
#include "recording/segment_writer.h"

namespace relocd {

/// Writes every message of both networks into segments, in the order of arrival.
///
/// Thread-bound.
class RecorderNode {
 public:
  /// @param run_id  of this process; its lowest digits tell the files of two runs apart.
  RecorderNode(const RecorderConfig& config,
               std::int64_t run_id,
               SegmentWriter::FreeSpace free_space = SegmentWriter::FreeSpaceOfDisk);

  /// @return kUnavailable when the folder cannot be made.
  Result<void> Start() { return segments_.Open(); }

  void Handle(const std::string& channel,
              std::span<const std::uint8_t> bytes,
              std::int64_t realtime_us);

  /// To be called every flush_s.
  void Flush() { segments_.Flush(); }

  /// Writes what is in memory, and waits for the disk.
  Result<void> Stop() { return segments_.Close(); }

  /// A disk that is full takes a little now and then: it is said until it has taken all for a
  /// while.
  [[nodiscard]] NodeStatus Status(const ClockReading& now);

 private:
  SegmentWriter segments_;
  std::int64_t told_dropped_ = 0;              ///< When Status was last asked.
  std::optional<MonotonicTime> dropped_time_;  ///< When events were last seen to be dropped.
};

}  // namespace relocd
