#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "core/result.h"
#include "core/unique_fd.h"
#include "recording/log_event.h"

namespace relocd {

/// Reads a log of lcm-logger's format event by event, and goes on behind damage at the next event
/// that is whole, where LCM's own reader stops for good.
class LogReader {
 public:
  /// @return kUnavailable when the file cannot be read; kInvalidInput when it has something in it,
  ///         but no event, and does not begin as a log does.
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
  explicit LogReader(UniqueFd fd) : fd_(std::move(fd)) {}

  /// The next whole event of the file.
  std::optional<LogEvent> FindEvent();

  /// The whole event that begins where we are, with another one or the end of the file behind it: a
  /// damaged length would otherwise swallow what follows.
  std::optional<LogEvent> ReadEvent();

  /// Whether `size` bytes follow where we are, after reading more of the file if need be.
  bool Has(std::size_t size);
  [[nodiscard]] std::uint64_t BigEndianAt(std::size_t offset, std::size_t size) const;

  UniqueFd fd_;
  std::string buffer_;             ///< A part of the file.
  std::size_t begin_ = 0;          ///< Where we are, in the buffer.
  std::optional<LogEvent> first_;  ///< Read to see that the file is a log.
  Counters counters_;
};

}  // namespace relocd
