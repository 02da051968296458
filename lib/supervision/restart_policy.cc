#include "supervision/restart_policy.h"

#include <algorithm>

#include "core/exit_code.h"

namespace relocd {
namespace {

/// So that a child cannot talk itself out of being watched.
constexpr Duration kMaxExtension = std::chrono::minutes(10);

constexpr Duration kKillAgainAfter = std::chrono::seconds(1);

RestartState Enter(RestartState state, ProcessState next, MonotonicTime now) {
  state.state = next;
  state.entered = now;
  state.deadline = kNever;
  return state;
}

MonotonicTime WatchdogDeadline(MonotonicTime now, Duration timeout, const RestartLimits& limits) {
  return limits.watchdog == Duration::zero() ? kNever : now + timeout;
}

RestartTransition Start(const RestartState& state, MonotonicTime now, const RestartLimits& limits) {
  // Who is not watched is not expected to say that it is ready either.
  const bool is_watched = limits.watchdog != Duration::zero();
  RestartState next =
      Enter(state, is_watched ? ProcessState::kStarting : ProcessState::kReady, now);
  next.started = now;
  // Until its event loop turns for the first time it may load a map or open a device.
  next.deadline = WatchdogDeadline(now, std::max(limits.start_timeout, limits.watchdog), limits);
  next.starts = state.starts + 1;
  next.restarts_at_once = false;
  return {next, RestartAction::kStart};
}

RestartTransition Stop(const RestartState& state,
                       RestartAction action,
                       MonotonicTime now,
                       Duration timeout) {
  RestartState next = Enter(state, ProcessState::kStopping, now);
  next.deadline = now + timeout;
  return {next, action};
}

RestartTransition BackOff(const RestartState& state,
                          MonotonicTime now,
                          const RestartLimits& limits) {
  RestartState next = Enter(state, ProcessState::kBackoff, now);
  const bool is_first = state.backoff == Duration::zero();
  const bool ran_well = now - state.started >= limits.backoff_reset;
  next.backoff = is_first || ran_well ? limits.backoff_initial
                                      : std::min(2 * state.backoff, limits.backoff_max);
  next.deadline = now + next.backoff;
  return {next, RestartAction::kNone};
}

RestartTransition OnExited(const RestartState& state,
                           int exit_code,
                           MonotonicTime now,
                           const RestartLimits& limits) {
  if (!state.is_wanted) return {Enter(state, ProcessState::kStopped, now), RestartAction::kNone};
  if (state.restarts_at_once) return Start(state, now, limits);
  if (exit_code == kExitConfig) {
    return {Enter(state, ProcessState::kFailed, now), RestartAction::kNone};
  }
  return BackOff(state, now, limits);
}

RestartTransition WhileWaiting(const RestartState& state,
                               const RestartEvent& event,
                               MonotonicTime now,
                               const RestartLimits& limits) {
  switch (event.kind) {
    case RestartEventKind::kDependenciesMet:
      return Start(state, now, limits);
    case RestartEventKind::kStop:
      return {Enter(state, ProcessState::kStopped, now), {}};
    default:
      return {state, RestartAction::kNone};
  }
}

/// Starting or ready.
RestartTransition WhileUp(const RestartState& state,
                          const RestartEvent& event,
                          MonotonicTime now,
                          const RestartLimits& limits) {
  RestartState next = state;
  switch (event.kind) {
    case RestartEventKind::kReady:
      if (state.state == ProcessState::kStarting) next = Enter(state, ProcessState::kReady, now);
      [[fallthrough]];
    case RestartEventKind::kAlive:
      next.deadline = WatchdogDeadline(now, limits.watchdog, limits);
      return {next, RestartAction::kNone};
    case RestartEventKind::kExtend: {
      const Duration extension = std::clamp(event.extension, Duration::zero(), kMaxExtension);
      next.deadline = std::max(state.deadline, WatchdogDeadline(now, extension, limits));
      return {next, RestartAction::kNone};
    }
    case RestartEventKind::kSupervisorLate:
      next.deadline = std::max(state.deadline, WatchdogDeadline(now, limits.watchdog, limits));
      return {next, RestartAction::kNone};
    case RestartEventKind::kTick:
      if (now < state.deadline) return {state, RestartAction::kNone};
      [[fallthrough]];
    case RestartEventKind::kHung:
      return Stop(state, RestartAction::kAbort, now, limits.abort_timeout);
    case RestartEventKind::kEnding:
      return Stop(state, RestartAction::kNone, now, limits.stop_timeout);
    case RestartEventKind::kRestart:
      next.restarts_at_once = true;
      return Stop(next, RestartAction::kTerminate, now, limits.stop_timeout);
    case RestartEventKind::kStop:
      next.is_wanted = false;
      return Stop(next, RestartAction::kTerminate, now, limits.stop_timeout);
    case RestartEventKind::kExited:
      return OnExited(state, event.exit_code, now, limits);
    default:
      return {state, RestartAction::kNone};
  }
}

RestartTransition WhileStopping(const RestartState& state,
                                const RestartEvent& event,
                                MonotonicTime now,
                                const RestartLimits& limits) {
  RestartState next = state;
  switch (event.kind) {
    case RestartEventKind::kTick:
      if (now < state.deadline) return {state, RestartAction::kNone};
      next.deadline = now + kKillAgainAfter;
      return {next, RestartAction::kKillGroup};
    case RestartEventKind::kStop:
      // It may have hung or end by itself: SIGTERM does no harm then, and the time runs already.
      next.is_wanted = false;
      return {next, RestartAction::kTerminate};
    case RestartEventKind::kRestart:
      next.is_wanted = true;
      next.restarts_at_once = true;
      return {next, RestartAction::kTerminate};
    case RestartEventKind::kExited:
      return OnExited(state, event.exit_code, now, limits);
    default:
      return {state, RestartAction::kNone};
  }
}

RestartTransition WhileBackingOff(const RestartState& state,
                                  const RestartEvent& event,
                                  MonotonicTime now,
                                  const RestartLimits& limits) {
  switch (event.kind) {
    case RestartEventKind::kTick:
      if (now < state.deadline) return {state, RestartAction::kNone};
      return Start(state, now, limits);
    case RestartEventKind::kRestart:
    case RestartEventKind::kReload:
      return Start(state, now, limits);
    case RestartEventKind::kStop:
      return {Enter(state, ProcessState::kStopped, now), {}};
    default:
      return {state, RestartAction::kNone};
  }
}

/// Stopped or failed.
RestartTransition WhileDown(const RestartState& state,
                            const RestartEvent& event,
                            MonotonicTime now) {
  switch (event.kind) {
    case RestartEventKind::kRestart:
    case RestartEventKind::kReload: {
      RestartState next = Enter(state, ProcessState::kWaiting, now);
      next.is_wanted = true;
      next.backoff = Duration::zero();
      return {next, RestartAction::kNone};
    }
    case RestartEventKind::kStop:
      return {Enter(state, ProcessState::kStopped, now), {}};
    default:
      return {state, RestartAction::kNone};
  }
}

}  // namespace

std::string_view NameOf(ProcessState state) {
  switch (state) {
    case ProcessState::kWaiting:
      return "WAITING";
    case ProcessState::kStarting:
      return "STARTING";
    case ProcessState::kReady:
      return "READY";
    case ProcessState::kBackoff:
      return "BACKOFF";
    case ProcessState::kStopping:
      return "STOPPING";
    case ProcessState::kStopped:
      return "STOPPED";
    case ProcessState::kFailed:
      return "FAILED";
  }
  return "UNKNOWN";
}

RestartTransition Advance(const RestartState& state,
                          const RestartEvent& event,
                          MonotonicTime now,
                          const RestartLimits& limits) {
  switch (state.state) {
    case ProcessState::kWaiting:
      return WhileWaiting(state, event, now, limits);
    case ProcessState::kStarting:
    case ProcessState::kReady:
      return WhileUp(state, event, now, limits);
    case ProcessState::kBackoff:
      return WhileBackingOff(state, event, now, limits);
    case ProcessState::kStopping:
      return WhileStopping(state, event, now, limits);
    case ProcessState::kStopped:
    case ProcessState::kFailed:
      return WhileDown(state, event, now);
  }
  return {state, RestartAction::kNone};
}

}  // namespace relocd
