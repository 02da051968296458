#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "core/time.h"
#include "core/unique_fd.h"
#include "supervision/process_spec.h"
#include "supervision/restart_policy.h"

namespace relocd {

struct SupervisorOptions {
  Duration backoff_initial = std::chrono::milliseconds(100);
  Duration backoff_max = std::chrono::seconds(5);
  Duration backoff_reset = std::chrono::seconds(30);
  Duration abort_timeout = std::chrono::seconds(2);

  /// Looks after its children so often, even if nothing happens.
  Duration period = std::chrono::milliseconds(100);

  /// When it comes so much later than that, no child is called hung: who starves the supervisor
  /// starves the children too.
  Duration late = std::chrono::milliseconds(500);

  /// Of all children, as `NAME=value`.
  std::vector<std::string> environment{};

  /// Told what happens, one line each, with syslog's priority (3 error, 4 warning, 6 info).
  std::function<void(int priority, const std::string& text)> on_event{};
};

/// How one child is.
struct ProcessReport {
  std::string name;
  ProcessState state = ProcessState::kWaiting;
  int pid = 0;  ///< 0 when it does not run.
  int restarts = 0;
  int last_exit_code = -1;  ///< -1: has not ended yet; 128 + n: by signal n.
  double uptime_s = 0.0;
  double watchdog_age_s = 0.0;  ///< Since its last sign of life.
  double backoff_s = 0.0;       ///< Until the next start.
  std::int64_t resident_bytes = 0;
  std::string status_text{};
};

/// Starts, watches, restarts and stops a table of child processes.
///
/// Each starts when those that it comes after are ready, have failed, or had their start_timeout_s.
/// One that ends starts again after a back-off, unless it ended with exit code 78 (bad config). One
/// that gives no sign of life is aborted, and then killed with its group.
///
/// Thread-bound: to be used by the thread that created it, with whose end the children end. Blocks
/// only while a program is loaded.
class Supervisor {
 public:
  static Result<Supervisor> Create(SupervisorOptions options);

  /// Kills what still runs.
  ~Supervisor();
  Supervisor(Supervisor&& other) noexcept;
  Supervisor& operator=(Supervisor&& other) noexcept;
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Readable when Handle has something to do.
  [[nodiscard]] int fd() const { return epoll_.get(); }

  /// Does what is due.
  void Handle(MonotonicTime now);

  /// Replaces the table: starts who is new, stops who is gone, restarts who has changed, tries
  /// again who had failed, and leaves all others alone.
  void Apply(std::vector<ProcessSpec> table, MonotonicTime now);

  /// For the children that end from now on.
  void SetBackoff(Duration initial, Duration max, Duration reset);

  /// Stops all children tier by tier: the next tier when all of one have ended.
  void Stop(MonotonicTime now);

  [[nodiscard]] bool has_stopped() const;

  [[nodiscard]] std::vector<ProcessReport> Reports(MonotonicTime now) const;

  /// A number that grows with each change of a child's state.
  [[nodiscard]] std::int64_t changes() const { return changes_; }

 private:
  struct Child;

  Supervisor(SupervisorOptions options, UniqueFd epoll, UniqueFd timer);

  [[nodiscard]] RestartLimits LimitsOf(const Child& child) const;
  [[nodiscard]] bool HasNothingToWaitFor(const Child& child, MonotonicTime now) const;
  [[nodiscard]] const Child* Find(std::string_view name) const;

  void Feed(Child& child, const RestartEvent& event, MonotonicTime now);
  void Perform(Child& child, RestartAction action, MonotonicTime now);
  void Start(Child& child, MonotonicTime now);
  void Listen(Child& child, MonotonicTime now);
  void CheckEnd(Child& child, MonotonicTime now);
  void CheckMemory(Child& child, MonotonicTime now);
  void StopNextTier(MonotonicTime now);
  void Adopt(Child& child, ProcessSpec spec, MonotonicTime now);
  void ArmTimer(MonotonicTime now);
  void LogTransition(const Child& child, const RestartState& before, const RestartEvent& event);
  void Log(int priority, const std::string& text) const;
  void Watch(int fd) const;
  [[nodiscard]] std::vector<std::string> EnvironmentOf(const Child& child) const;

  SupervisorOptions options_;
  UniqueFd epoll_;
  UniqueFd timer_;
  std::vector<std::unique_ptr<Child>> children_;
  MonotonicTime handled_{};  ///< When Handle last ran.
  MonotonicTime memory_checked_{};
  std::int64_t changes_ = 0;
  bool is_stopping_ = false;
};

}  // namespace relocd
