#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/result.h"
#include "core/unique_fd.h"

namespace relocd {

/// Writes one log file of lcm-logger's format, which lcm-logplayer plays.
class LogWriter {
 public:
  /// Creates the file, or empties it. @return kUnavailable.
  static Result<LogWriter> Create(const std::string& path);

  /// Takes the event into memory, and writes when enough has come together.
  ///
  /// @return kUnavailable when the disk is full or gone; whole events stay whole in the file.
  Result<void> Append(std::int64_t timestamp_us,
                      std::string_view channel,
                      std::span<const std::uint8_t> data);

  /// Writes what is in memory. @return kUnavailable.
  Result<void> Flush();

  /// Another descriptor of the file, for who waits for the disk; invalid when there are too many.
  [[nodiscard]] UniqueFd DuplicateFd() const;

  /// Flush, and waits until the disk has it.
  Result<void> Sync();

  /// In the file and in memory.
  [[nodiscard]] std::int64_t size_bytes() const {
    return written_bytes_ + static_cast<std::int64_t>(buffer_.size());
  }
  [[nodiscard]] std::int64_t event_count() const { return event_count_; }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  LogWriter(UniqueFd fd, std::string path) : fd_(std::move(fd)), path_(std::move(path)) {}

  UniqueFd fd_;
  std::string path_;
  std::string buffer_;
  std::int64_t written_bytes_ = 0;
  std::int64_t event_count_ = 0;
};

}  // namespace relocd
