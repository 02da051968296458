#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "core/result.h"
#include "core/unique_fd.h"

namespace relocd {

/// Waits until the disk has what was written to a file, on a thread of its own: that takes from
/// milliseconds to seconds, in which messages must not wait.
///
/// Thread-safe.
class BackgroundSync {
 public:
  BackgroundSync();

  /// Returns at once. Of the files that are asked for while the disk is busy only the last counts.
  ///
  /// @param file  a descriptor of its own, as dup(2) makes it.
  void Request(UniqueFd file);

  /// How the last one went. @return kUnavailable when the disk refused.
  [[nodiscard]] Result<void> last_result() const;

 private:
  void Run(const std::stop_token& stop);

  mutable std::mutex mutex_;
  std::condition_variable_any has_file_;
  std::optional<UniqueFd> file_;  ///< Guarded by mutex_, as below.
  Result<void> last_result_;
  std::jthread thread_;  ///< Last, so that it ends first.
};

}  // namespace relocd
