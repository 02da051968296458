#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>

#include "core/result.h"
#include "recording/log_event.h"

namespace relocd {

/// Reads a log of lcm-logger's format event by event, and goes on behind damage at the next event
/// that is whole, where LCM's own reader stops for good.
class LogReader {
 public:
  /// @return kUnavailable when the file cannot be read.
  static Result<LogReader> Open(const std::string& path);

  /// The next whole event; nothing at the end.
  std::optional<LogEvent> Next();

  struct Counters {
    std::int64_t events = 0;
    std::int64_t skipped_bytes = 0;   ///< Bytes that belong to no whole event.
    std::int64_t damaged_places = 0;  ///< Runs of such bytes, a truncated end included.
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  explicit LogReader(std::ifstream file) : file_(std::move(file)) {}

  /// The event that begins at the file's position; nothing, with the position unspecified, if none
  /// does.
  std::optional<LogEvent> ReadEvent();

  std::ifstream file_;
  Counters counters_;
};

}  // namespace relocd
