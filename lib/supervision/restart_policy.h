#pragma once

#include <string_view>

#include "core/time.h"

namespace relocd {

/// Where a child is in its life. The numbers are those of process_t.
enum class ProcessState {
  kWaiting = 0,   ///< For those it starts after.
  kStarting = 1,  ///< Runs, has not said READY=1.
  kReady = 2,
  kBackoff = 3,   ///< Ended, will be started again.
  kStopping = 4,  ///< Was asked to end, or hung and was aborted.
  kStopped = 5,
  kFailed = 6,  ///< Its config is bad: not started again before a reload.
};

/// As in `READY`.
std::string_view NameOf(ProcessState state);

/// Whether a process belongs to the state.
constexpr bool IsRunning(ProcessState state) {
  return state == ProcessState::kStarting || state == ProcessState::kReady ||
         state == ProcessState::kStopping;
}

/// The times that decide.
struct RestartLimits {
  Duration watchdog = std::chrono::seconds(2);  ///< Zero: not watched.
  Duration start_timeout = std::chrono::seconds(10);
  Duration stop_timeout = std::chrono::seconds(2);
  Duration abort_timeout =
      std::chrono::seconds(2);  ///< From SIGABRT to SIGKILL: a core is written.
  Duration backoff_initial = std::chrono::milliseconds(100);
  Duration backoff_max = std::chrono::seconds(5);
  Duration backoff_reset = std::chrono::seconds(30);
};

inline constexpr MonotonicTime kNever = MonotonicTime::max();

/// What the policy remembers of one child.
struct RestartState {
  ProcessState state = ProcessState::kWaiting;
  MonotonicTime entered{};          ///< The state.
  MonotonicTime started{};          ///< The process, last.
  MonotonicTime deadline = kNever;  ///< When a kTick brings an action.
  Duration backoff{};               ///< Before the last start; zero: none yet.
  int starts = 0;
  bool is_wanted = true;          ///< To be started again when it has ended...
  bool restarts_at_once = false;  ///< ...without back-off.

  bool operator==(const RestartState&) const = default;
};

enum class RestartEventKind {
  kTick,             ///< Time has passed.
  kDependenciesMet,  ///< Nothing to wait for any longer.
  kReady,            ///< It said READY=1.
  kAlive,            ///< It said WATCHDOG=1.
  kExtend,          ///< It said EXTEND_TIMEOUT_USEC: no sign of life before `extension` has passed.
  kHung,            ///< It said WATCHDOG=trigger: it noticed itself that it hangs.
  kEnding,          ///< It said STOPPING=1.
  kSupervisorLate,  ///< The supervisor itself did not run: signs of life may have gone unheard.
  kExited,          ///< With `exit_code`, 128 + n for signal n.
  kStop,            ///< It is not wanted any longer.
  kRestart,         ///< Its config has changed, or it has grown too big.
  kReload,          ///< The config was read again: what had failed may work now.
};

struct RestartEvent {
  RestartEventKind kind = RestartEventKind::kTick;
  Duration extension{};
  int exit_code = 0;
};

enum class RestartAction {
  kNone,
  kStart,
  kTerminate,  ///< SIGTERM to the process.
  kAbort,      ///< SIGABRT to the process.
  kKillGroup,  ///< SIGKILL to its whole process group.
};

struct RestartTransition {
  RestartState next;
  RestartAction action = RestartAction::kNone;
};

/// What to do with a child when `event` comes at `now`. Pure: no clock, no process.
RestartTransition Advance(const RestartState& state,
                          const RestartEvent& event,
                          MonotonicTime now,
                          const RestartLimits& limits);

}  // namespace relocd
