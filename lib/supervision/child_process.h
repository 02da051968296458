#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/unique_fd.h"

namespace relocd {

/// What to run, and how.
struct LaunchOptions {
  std::vector<std::string> command;        ///< Path of the program, then its arguments.
  std::vector<std::string> environment{};  ///< All of it, as `NAME=value`.
  bool is_real_time = false;               ///< SCHED_FIFO with `priority`.
  int priority = 0;
  int nice = 0;
};

/// A running program in a process group of its own, which ends with this object at the latest, and
/// with the thread that started it.
///
/// Its stdin is /dev/null, stdout and stderr are ours; it inherits no other file, and blocks no
/// signal. Thread-bound.
class ChildProcess {
 public:
  /// Returns once the program was loaded, or could not be.
  ///
  /// @return kInvalidInput when there is no such program, or it cannot be run; kUnavailable when
  /// the system has no room for a process.
  static Result<ChildProcess> Start(const LaunchOptions& options);

  /// Kills the group and waits for the process.
  ~ChildProcess();
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&& other) noexcept;
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }

  /// A pidfd: readable when the process has ended.
  [[nodiscard]] int fd() const { return pidfd_.get(); }

  /// What was asked for and not granted (a scheduling class, a nice value), and how to mend it;
  /// empty when nothing.
  [[nodiscard]] const std::string& warning() const { return warning_; }

  /// To the process alone.
  void Signal(int signal) const;

  void KillGroup() const;

  /// When the process has ended: its exit code, 128 + n for signal n. What is left of its group is
  /// killed. Call it no more then.
  std::optional<int> Reap();

  /// Resident memory; 0 when it has ended.
  [[nodiscard]] std::int64_t ResidentBytes() const;

 private:
  ChildProcess(pid_t pid, UniqueFd pidfd) : pid_(pid), pidfd_(std::move(pidfd)) {}

  pid_t pid_ = 0;  ///< 0 when reaped.
  UniqueFd pidfd_;
  std::string warning_;
};

}  // namespace relocd
