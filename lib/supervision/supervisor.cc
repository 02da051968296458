#include "supervision/supervisor.h"

#include <signal.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <climits>
#include <cstdint>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "core/exit_code.h"
#include "core/file.h"
#include "supervision/child_process.h"
#include "supervision/notify_server.h"

namespace relocd {
namespace {

constexpr int kError = 3;
constexpr int kWarning = 4;
constexpr int kInfo = 6;

constexpr Duration kMemoryPeriod = std::chrono::milliseconds(500);

/// At most so many notifications of a child in one round: one that talks without end must not keep
/// the others waiting.
constexpr int kMaxNotifications = 64;

/// Of a program that could not be loaded for want of memory, as a shell has it.
constexpr int kExitNotLoaded = 126;

/// The fields that matter to the supervisor only are taken over without a restart.
bool NeedsRestart(ProcessSpec before, const ProcessSpec& after) {
  before.config.after = after.config.after;
  before.config.start_timeout_s = after.config.start_timeout_s;
  before.config.stop_timeout_s = after.config.stop_timeout_s;
  before.config.stop_tier = after.config.stop_tier;
  before.config.rss_limit_mb = after.config.rss_limit_mb;
  return before != after;
}

std::string DescribeExit(int exit_code) {
  if (exit_code > 128) {
    const char* name = ::sigabbrev_np(exit_code - 128);
    return name == nullptr ? fmt::format("ended by signal {}", exit_code - 128)
                           : fmt::format("ended by SIG{}", name);
  }
  return fmt::format("ended with exit code {}", exit_code);
}

}  // namespace

struct Supervisor::Child {
  explicit Child(ProcessSpec its_spec) : spec(std::move(its_spec)) {}

  ProcessSpec spec;
  RestartState state;
  std::optional<NotifyServer> notify;
  std::optional<ChildProcess> process;
  MonotonicTime last_sign{};  ///< Of life.
  int last_exit_code = -1;
  std::int64_t resident_bytes = 0;
  std::string status_text;
  bool could_not_start = false;
  bool is_leaving = false;  ///< Not in the table any longer: forgotten once it has ended.
};

Supervisor::Supervisor(SupervisorOptions options, UniqueFd epoll, UniqueFd timer)
    : options_(std::move(options)), epoll_(std::move(epoll)), timer_(std::move(timer)) {}
Supervisor::~Supervisor() = default;
Supervisor::Supervisor(Supervisor&& other) noexcept = default;
Supervisor& Supervisor::operator=(Supervisor&& other) noexcept = default;

Result<Supervisor> Supervisor::Create(SupervisorOptions options) {
  UniqueFd epoll(::epoll_create1(EPOLL_CLOEXEC));
  if (!epoll.valid()) return SystemError(ErrorKind::kInternal, "creating an epoll instance");
  UniqueFd timer(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
  if (!timer.valid()) return SystemError(ErrorKind::kInternal, "creating a timer");
  const int timer_fd = timer.get();
  Supervisor supervisor(std::move(options), std::move(epoll), std::move(timer));
  supervisor.Watch(timer_fd);
  return supervisor;
}

void Supervisor::Handle(MonotonicTime now) {
  std::uint64_t expirations = 0;
  static_cast<void>(::read(timer_.get(), &expirations, sizeof(expirations)));

  const bool is_late =
      handled_ != MonotonicTime{} && now - handled_ > options_.period + options_.late;
  for (const auto& child : children_) {
    Listen(*child, now);  // before its end, so that its last words are heard
    if (is_late) Feed(*child, {.kind = RestartEventKind::kSupervisorLate}, now);
    CheckEnd(*child, now);
  }
  if (is_late) {
    Log(kWarning,
        fmt::format("this supervisor did not run for {:.1f} s: the machine is overloaded, or it "
                    "was stopped",
                    ToSeconds(now - handled_)));
  }
  handled_ = now;

  for (const auto& child : children_) {
    if (child->state.state == ProcessState::kWaiting && HasNothingToWaitFor(*child, now)) {
      Feed(*child, {.kind = RestartEventKind::kDependenciesMet}, now);
    }
    Feed(*child, {.kind = RestartEventKind::kTick}, now);
  }
  if (now - memory_checked_ >= kMemoryPeriod) {
    memory_checked_ = now;
    for (const auto& child : children_)
      CheckMemory(*child, now);
  }
  if (is_stopping_) StopNextTier(now);
  std::erase_if(children_, [](const auto& child) {
    return child->is_leaving && !IsRunning(child->state.state);
  });
  ArmTimer(now);
}

void Supervisor::Apply(std::vector<ProcessSpec> table, MonotonicTime now) {
  if (is_stopping_) return;
  for (const auto& child : children_) {
    const bool stays = std::any_of(table.begin(), table.end(), [&](const ProcessSpec& spec) {
      return spec.name == child->spec.name;
    });
    if (stays) continue;
    child->is_leaving = true;
    Feed(*child, {.kind = RestartEventKind::kStop}, now);
  }
  for (ProcessSpec& spec : table) {
    const auto found = std::find_if(children_.begin(), children_.end(), [&](const auto& child) {
      return child->spec.name == spec.name;
    });
    if (found != children_.end()) {
      Adopt(**found, std::move(spec), now);
    } else {
      children_.push_back(std::make_unique<Child>(std::move(spec)));
      children_.back()->state.entered = now;
      ++changes_;
    }
  }
  ArmTimer(now - options_.period);  // at once
}

void Supervisor::SetBackoff(Duration initial, Duration max, Duration reset) {
  options_.backoff_initial = initial;
  options_.backoff_max = max;
  options_.backoff_reset = reset;
}

void Supervisor::Adopt(Child& child, ProcessSpec spec, MonotonicTime now) {
  const bool has_changed = child.is_leaving || NeedsRestart(child.spec, spec);
  child.is_leaving = false;
  child.spec = std::move(spec);
  if (has_changed && IsRunning(child.state.state)) {
    Log(kInfo, child.spec.name + ": its config has changed, restarting it");
  }
  Feed(child, {.kind = has_changed ? RestartEventKind::kRestart : RestartEventKind::kReload}, now);
}

void Supervisor::Stop(MonotonicTime now) {
  if (is_stopping_) return;
  is_stopping_ = true;
  for (const auto& child : children_) {
    // Who ends already, to be started again, is not.
    if (child->state.state == ProcessState::kStopping) {
      Feed(*child, {.kind = RestartEventKind::kStop}, now);
    }
  }
  StopNextTier(now);
  ArmTimer(now);
}

void Supervisor::StopNextTier(MonotonicTime now) {
  int tier = INT_MAX;
  for (const auto& child : children_) {
    if (!IsRunning(child->state.state)) Feed(*child, {.kind = RestartEventKind::kStop}, now);
    if (IsRunning(child->state.state)) tier = std::min(tier, child->spec.config.stop_tier);
  }
  for (const auto& child : children_) {
    const bool is_next = IsRunning(child->state.state) && child->spec.config.stop_tier == tier;
    if (is_next && child->state.is_wanted) Feed(*child, {.kind = RestartEventKind::kStop}, now);
  }
}

bool Supervisor::has_stopped() const {
  return is_stopping_ && std::none_of(children_.begin(), children_.end(), [](const auto& child) {
           return IsRunning(child->state.state);
         });
}

RestartLimits Supervisor::LimitsOf(const Child& child) const {
  const ProcessConfig& config = child.spec.config;
  return {.watchdog = FromSeconds(config.watchdog_s),
          .start_timeout = FromSeconds(config.start_timeout_s),
          .stop_timeout = FromSeconds(config.stop_timeout_s),
          .abort_timeout = options_.abort_timeout,
          .backoff_initial = options_.backoff_initial,
          .backoff_max = options_.backoff_max,
          .backoff_reset = options_.backoff_reset};
}

const Supervisor::Child* Supervisor::Find(std::string_view name) const {
  for (const auto& child : children_) {
    if (child->spec.name == name) return child.get();
  }
  return nullptr;
}

bool Supervisor::HasNothingToWaitFor(const Child& child, MonotonicTime now) const {
  const auto& after = child.spec.config.after;
  return std::all_of(after.begin(), after.end(), [&](const std::string& name) {
    const Child* other = Find(name);
    if (other == nullptr) return true;
    const ProcessState state = other->state.state;
    return state == ProcessState::kReady || state == ProcessState::kFailed ||
           state == ProcessState::kStopped ||
           now - child.state.entered >= FromSeconds(other->spec.config.start_timeout_s);
  });
}

void Supervisor::Feed(Child& child, const RestartEvent& event, MonotonicTime now) {
  const RestartState before = child.state;
  const RestartTransition transition = Advance(before, event, now, LimitsOf(child));
  child.state = transition.next;
  if (before.state != child.state.state) {
    ++changes_;
    LogTransition(child, before, event);
  }
  Perform(child, transition.action, now);
}

void Supervisor::Perform(Child& child, RestartAction action, MonotonicTime now) {
  switch (action) {
    case RestartAction::kNone:
      return;
    case RestartAction::kStart:
      return Start(child, now);
    case RestartAction::kTerminate:
      if (child.process) child.process->Signal(SIGTERM);
      return;
    case RestartAction::kAbort:
      // A stopped process takes no SIGABRT before it goes on.
      if (child.process) child.process->Signal(SIGABRT);
      if (child.process) child.process->Signal(SIGCONT);
      return;
    case RestartAction::kKillGroup:
      Log(kWarning, child.spec.name + ": did not end in time, killing its process group");
      if (child.process) child.process->KillGroup();
      return;
  }
}

void Supervisor::Start(Child& child, MonotonicTime now) {
  child.status_text.clear();
  child.could_not_start = false;
  child.last_sign = now;
  child.process.reset();
  if (!child.notify) {
    auto notify = NotifyServer::Open();
    if (!notify) {
      Log(kError, child.spec.name + ": " + notify.error().message);
      return Feed(child, {.kind = RestartEventKind::kExited, .exit_code = kExitNotLoaded}, now);
    }
    child.notify.emplace(std::move(notify).value());
    Watch(child.notify->fd());
  }
  const ProcessConfig& config = child.spec.config;
  auto process = ChildProcess::Start({.command = config.command,
                                      .environment = EnvironmentOf(child),
                                      .is_real_time = config.scheduling == "fifo",
                                      .priority = config.priority,
                                      .nice = config.nice});
  if (!process) {
    Log(kError, child.spec.name + ": " + process.error().message);
    child.status_text = process.error().message;
    child.could_not_start = true;
    child.last_exit_code =
        process.error().kind == ErrorKind::kInvalidInput ? kExitConfig : kExitNotLoaded;
    return Feed(child, {.kind = RestartEventKind::kExited, .exit_code = child.last_exit_code}, now);
  }
  if (!process->warning().empty() && child.state.starts == 1) {
    Log(kWarning, child.spec.name + ": " + process->warning());
  }
  child.process.emplace(std::move(process).value());
  Watch(child.process->fd());
}

std::vector<std::string> Supervisor::EnvironmentOf(const Child& child) const {
  std::vector<std::string> environment = options_.environment;
  environment.push_back("NOTIFY_SOCKET=" + child.notify->address());
  if (child.spec.config.watchdog_s > 0.0) {
    environment.push_back(fmt::format("WATCHDOG_USEC={:.0f}", child.spec.config.watchdog_s * 1e6));
  }
  return environment;
}

void Supervisor::Listen(Child& child, MonotonicTime now) {
  if (!child.notify) return;
  const pid_t pid = child.process ? child.process->pid() : 0;
  for (int i = 0; i < kMaxNotifications; ++i) {
    auto notification = child.notify->Receive(pid);
    if (!notification) return;
    child.last_sign = now;
    if (notification->status) child.status_text = std::move(*notification->status);
    if (notification->ready) Feed(child, {.kind = RestartEventKind::kReady}, now);
    if (notification->alive) Feed(child, {.kind = RestartEventKind::kAlive}, now);
    if (notification->extend_timeout) {
      Feed(child,
           {.kind = RestartEventKind::kExtend, .extension = *notification->extend_timeout},
           now);
    }
    if (notification->stopping) Feed(child, {.kind = RestartEventKind::kEnding}, now);
    if (notification->hung) Feed(child, {.kind = RestartEventKind::kHung}, now);
  }
}

void Supervisor::CheckEnd(Child& child, MonotonicTime now) {
  if (!child.process) return;
  const auto exit_code = child.process->Reap();
  if (!exit_code) return;
  child.process.reset();
  child.resident_bytes = 0;
  child.last_exit_code = *exit_code;
  Feed(child, {.kind = RestartEventKind::kExited, .exit_code = *exit_code}, now);
}

void Supervisor::CheckMemory(Child& child, MonotonicTime now) {
  if (!child.process) return;
  child.resident_bytes = child.process->ResidentBytes();
  const double limit = child.spec.config.rss_limit_mb * 1e6;
  const bool is_up =
      child.state.state == ProcessState::kStarting || child.state.state == ProcessState::kReady;
  if (is_stopping_ || !is_up || limit == 0.0 || static_cast<double>(child.resident_bytes) <= limit)
    return;
  Log(kWarning,
      fmt::format("{}: has {:.0f} MB of resident memory, may have {:.0f}: restarting it",
                  child.spec.name,
                  static_cast<double>(child.resident_bytes) * 1e-6,
                  child.spec.config.rss_limit_mb));
  Feed(child, {.kind = RestartEventKind::kRestart}, now);
}

void Supervisor::ArmTimer(MonotonicTime now) {
  MonotonicTime next = now + options_.period;
  for (const auto& child : children_)
    next = std::min(next, child->state.deadline);
  const auto since_epoch = std::max(next.time_since_epoch(), Duration(1));
  itimerspec spec{};
  spec.it_value.tv_sec = since_epoch / std::chrono::seconds(1);
  spec.it_value.tv_nsec = (since_epoch % std::chrono::seconds(1)).count();
  ::timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &spec, nullptr);
}

void Supervisor::LogTransition(const Child& child,
                               const RestartState& before,
                               const RestartEvent& event) {
  const std::string& name = child.spec.name;
  const RestartState& after = child.state;
  switch (after.state) {
    case ProcessState::kReady:
      Log(kInfo,
          fmt::format("{}: ready {:.2f} s after its start",
                      name,
                      ToSeconds(after.entered - after.started)));
      return;
    case ProcessState::kBackoff:
      Log(kWarning,
          fmt::format("{}: {}, starts again in {:.1f} s",
                      name,
                      DescribeExit(event.exit_code),
                      ToSeconds(after.backoff)));
      return;
    case ProcessState::kFailed:
      Log(kError,
          fmt::format("{}: {}: mend it and reload relocd (systemctl reload relocd, or SIGHUP)",
                      name,
                      child.could_not_start ? "cannot be started"
                                            : "exit code 78 says that its input is wrong"));
      return;
    case ProcessState::kStopping:
      if (event.kind == RestartEventKind::kTick || event.kind == RestartEventKind::kHung) {
        Log(kError,
            fmt::format("{}: gave no sign of life for {:.1f} s: aborting it",
                        name,
                        ToSeconds(after.entered - child.last_sign)));
      }
      return;
    case ProcessState::kStopped:
      if (IsRunning(before.state)) Log(kInfo, name + ": stopped");
      return;
    default:
      return;
  }
}

std::vector<ProcessReport> Supervisor::Reports(MonotonicTime now) const {
  std::vector<ProcessReport> reports;
  for (const auto& child : children_) {
    ProcessReport report{.name = child->spec.name,
                         .state = child->state.state,
                         .restarts = std::max(child->state.starts - 1, 0),
                         .last_exit_code = child->last_exit_code,
                         .resident_bytes = child->resident_bytes,
                         .status_text = child->status_text};
    if (child->process) {
      report.pid = child->process->pid();
      report.uptime_s = ToSeconds(now - child->state.started);
      report.watchdog_age_s = ToSeconds(now - child->last_sign);
    }
    if (report.state == ProcessState::kBackoff) {
      report.backoff_s = std::max(ToSeconds(child->state.deadline - now), 0.0);
    }
    reports.push_back(std::move(report));
  }
  return reports;
}

void Supervisor::Log(int priority, const std::string& text) const {
  if (options_.on_event) options_.on_event(priority, text);
}

void Supervisor::Watch(int fd) const {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = fd;
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event);
}

}  // namespace relocd
