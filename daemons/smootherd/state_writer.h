#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "core/result.h"

namespace relocd {

/// Writes the newest of the texts it is given to a file, on a thread of its own: to sync a file
/// takes tens of milliseconds on some disks, and a pose must not wait for that.
///
/// Thread-safe.
class StateWriter {
 public:
  /// @param path  its folder is made if it is not there.
  explicit StateWriter(std::string path);

  /// Replaces a text that still waits.
  void Write(std::string text);

  /// How the last write went.
  [[nodiscard]] Result<void> last_result() const;

 private:
  void Run(const std::stop_token& stop);

  std::string path_;
  mutable std::mutex mutex_;
  std::condition_variable_any has_text_;
  std::optional<std::string> text_;  ///< Guarded by mutex_, as all below.
  Result<void> last_result_;
  std::jthread thread_;  ///< Last, so that it ends first; it writes what waits before it does.
};

}  // namespace relocd
