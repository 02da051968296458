#include "supervision/child_process.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/close_range.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <sched.h>

#include "core/file.h"
#include "core/parse_number.h"

namespace relocd {
namespace {

/// A real-time process that computes for so long without ever waiting is in an endless loop, and
/// the kernel ends it, in case the supervisor is kept from doing so by that very loop. Much longer
/// than the watchdog's 2 s: the kernel's own work for the process counts too, as when it searches
/// for memory, and only the supervisor knows whether the whole machine stood still meanwhile.
constexpr rlim_t kMaxRealTimeRunUs = 10'000'000;

/// glibc 2.36 has the function, but its header forgets that it is C.
UniqueFd OpenPidfd(pid_t pid) {
  return UniqueFd(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
}

/// What the child reports through a pipe before it becomes the program.
struct LaunchReport {
  enum class Step : int { kScheduling, kNice, kExec };
  Step step;
  int error;
};

std::vector<char*> Pointers(const std::vector<std::string>& strings) {
  std::vector<char*> pointers;
  pointers.reserve(strings.size() + 1);
  for (const std::string& string : strings)
    pointers.push_back(const_cast<char*>(string.c_str()));  // execve does not write to them
  pointers.push_back(nullptr);
  return pointers;
}

/// Everything between fork and exec. Another thread may have held any lock at the fork: only
/// async-signal-safe calls here, and no memory from the heap.
class Launcher {
 public:
  explicit Launcher(const LaunchOptions& options)
      : options_(options),
        arguments_(Pointers(options.command)),
        environment_(Pointers(options.environment)),
        parent_(::getpid()),
        null_(::open("/dev/null", O_RDWR | O_CLOEXEC)) {}

  [[noreturn]] void Run(int report_fd) const {
    ::setpgid(0, 0);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent_) ::_exit(1);  // it ended before the line above
    if (null_.valid()) ::dup2(null_.get(), STDIN_FILENO);
    Schedule(report_fd);
    ResetSignals();
    ::close_range(3, ~0U, CLOSE_RANGE_CLOEXEC);
    ::execve(arguments_[0], arguments_.data(), environment_.data());
    Report(report_fd, LaunchReport::Step::kExec);
    ::_exit(127);
  }

 private:
  void Schedule(int report_fd) const {
    if (options_.nice != 0 && ::setpriority(PRIO_PROCESS, 0, options_.nice) != 0) {
      Report(report_fd, LaunchReport::Step::kNice);
    }
    if (!options_.is_real_time) return;
    rlimit limit{};
    if (::getrlimit(RLIMIT_RTTIME, &limit) == 0) {
      limit.rlim_cur = std::min<rlim_t>(kMaxRealTimeRunUs, limit.rlim_max);
      ::setrlimit(RLIMIT_RTTIME, &limit);
    }
    sched_param parameters{};
    parameters.sched_priority = options_.priority;
    if (::sched_setscheduler(0, SCHED_FIFO, &parameters) != 0) {
      Report(report_fd, LaunchReport::Step::kScheduling);
    }
  }

  static void ResetSignals() {
    struct sigaction action {};
    action.sa_handler = SIG_DFL;
    for (int signal = 1; signal < NSIG; ++signal)
      ::sigaction(signal, &action, nullptr);  // refused for some, which keep their default anyway
    sigset_t none;
    ::sigemptyset(&none);
    ::pthread_sigmask(SIG_SETMASK, &none, nullptr);
  }

  static void Report(int fd, LaunchReport::Step step) {
    const LaunchReport report{.step = step, .error = errno};
    // Below PIPE_BUF, so whole or not at all; without it the parent only knows less.
    static_cast<void>(::write(fd, &report, sizeof(report)) == sizeof(report));
  }

  const LaunchOptions& options_;
  std::vector<char*> arguments_;
  std::vector<char*> environment_;
  pid_t parent_;
  UniqueFd null_;
};

std::string Describe(int error) {
  return std::generic_category().message(error);
}

std::string SchedulingWarning(const LaunchReport& report, const LaunchOptions& options) {
  if (report.step == LaunchReport::Step::kScheduling) {
    return fmt::format(
        "SCHED_FIFO {} is refused: {}; runs without real time, so pose latency grows when the CPU "
        "is busy (relocd.service has LimitRTPRIO=; in a root shell: ulimit -r {})",
        options.priority,
        Describe(report.error),
        options.priority);
  }
  return fmt::format("nice {} is refused: {}", options.nice, Describe(report.error));
}

/// Reads until the program was loaded, which closes the pipe's other end.
Result<std::string> ReadReports(int fd, const LaunchOptions& options) {
  std::string warning;
  LaunchReport report{};
  while (true) {
    const ssize_t size = ::read(fd, &report, sizeof(report));
    if (size < 0 && errno == EINTR) continue;
    if (size != static_cast<ssize_t>(sizeof(report))) return warning;
    if (report.step == LaunchReport::Step::kExec) {
      const bool may_succeed_later = report.error == ENOMEM || report.error == EAGAIN ||
                                     report.error == ETXTBSY || report.error == EMFILE ||
                                     report.error == ENFILE;
      return Error{may_succeed_later ? ErrorKind::kUnavailable : ErrorKind::kInvalidInput,
                   fmt::format("starting {}: {}", options.command.front(), Describe(report.error))};
    }
    if (!warning.empty()) warning += "; ";
    warning += SchedulingWarning(report, options);
  }
}

}  // namespace

Result<ChildProcess> ChildProcess::Start(const LaunchOptions& options) {
  if (options.command.empty()) {
    return Error{ErrorKind::kInvalidInput, "starting a process: its command is empty"};
  }
  std::array<int, 2> pipe{};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0) {
    return SystemError(ErrorKind::kUnavailable, "opening a pipe");
  }
  const UniqueFd reader(pipe[0]);
  UniqueFd writer(pipe[1]);
  const Launcher launcher(options);

  const pid_t pid = ::fork();
  if (pid < 0) return SystemError(ErrorKind::kUnavailable, "starting " + options.command.front());
  if (pid == 0) launcher.Run(writer.get());

  writer = UniqueFd();
  // Not reaped before this object is gone, so the number is still the child's.
  ChildProcess child(pid, OpenPidfd(pid));
  if (!child.pidfd_.valid()) return SystemError(ErrorKind::kInternal, "opening a pidfd");
  auto warning = ReadReports(reader.get(), options);
  if (!warning) return std::move(warning).error();
  child.warning_ = std::move(warning).value();
  return child;
}

ChildProcess::~ChildProcess() {
  if (pid_ == 0) return;
  KillGroup();
  siginfo_t status{};
  while (::waitid(P_PID, static_cast<id_t>(pid_), &status, WEXITED) != 0 && errno == EINTR) {
  }
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept
    : pid_(std::exchange(other.pid_, 0)),
      pidfd_(std::move(other.pidfd_)),
      warning_(std::move(other.warning_)) {}

ChildProcess& ChildProcess::operator=(ChildProcess&& other) noexcept {
  std::swap(pid_, other.pid_);  // `other` ends what this held
  std::swap(pidfd_, other.pidfd_);
  std::swap(warning_, other.warning_);
  return *this;
}

void ChildProcess::Signal(int signal) const {
  if (pid_ > 0) ::kill(pid_, signal);
}

void ChildProcess::KillGroup() const {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGKILL);  // the group may not be made yet
  ::kill(-pid_, SIGKILL);
}

std::optional<int> ChildProcess::Reap() {
  if (pid_ == 0) return std::nullopt;
  const auto id = static_cast<id_t>(pid_);
  siginfo_t status{};
  if (::waitid(P_PID, id, &status, WEXITED | WNOHANG | WNOWAIT) != 0 || status.si_pid == 0) {
    return std::nullopt;
  }
  // While the process is not reaped its number cannot be given to another group.
  ::kill(-pid_, SIGKILL);
  while (::waitid(P_PID, id, &status, WEXITED) != 0 && errno == EINTR) {
  }
  pid_ = 0;
  return status.si_code == CLD_EXITED ? status.si_status : 128 + status.si_status;
}

std::int64_t ChildProcess::ResidentBytes() const {
  if (pid_ == 0) return 0;
  const auto text = ReadFile(fmt::format("/proc/{}/statm", pid_));
  if (!text) return 0;
  const std::size_t begin = text->find(' ');
  if (begin == std::string::npos) return 0;
  const auto pages = ParseInt64(text->substr(begin + 1, text->find(' ', begin + 1) - begin - 1));
  return pages.value_or(0) * ::sysconf(_SC_PAGESIZE);
}

}  // namespace relocd
