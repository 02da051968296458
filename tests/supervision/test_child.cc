// A child for the supervisor's tests: does what its arguments say, one after the other.
//
//   test_child NAME LOGFILE STEP...
//
// and adds lines such as `NAME start`, `NAME term` to the log file. The steps:
//   ready  status:TEXT  wait (signs of life until SIGTERM)  alive:MS (signs of life for so long)
//   hang  exit:CODE  ignore-term  fork (a grandchild that ignores SIGTERM, its pid in the log)
//   describe (how it was started, into the log)  grow:MB

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <sched.h>

#include "core/parse_number.h"
#include "core/time.h"
#include "core/unique_fd.h"
#include "runtime/service_manager.h"

namespace relocd {
namespace {

using namespace std::chrono_literals;

class TestChild {
 public:
  TestChild(std::string name, const std::string& log_path)
      : name_(std::move(name)),
        log_(::open(log_path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600)),
        manager_(ServiceManager::FromEnvironment()) {
    ::sigemptyset(&term_);
    ::sigaddset(&term_, SIGTERM);
    ::pthread_sigmask(SIG_BLOCK, nullptr, &inherited_);
    ::pthread_sigmask(SIG_BLOCK, &term_, nullptr);
    Log("start");
  }

  /// Ends the process for some.
  void Do(std::string_view step) {
    const auto colon = std::min(step.find(':'), step.size());
    const std::string_view verb = step.substr(0, colon);
    const std::string_view argument = step.substr(std::min(colon + 1, step.size()));
    const int number = static_cast<int>(ParseInt64(argument).value_or(0));
    if (verb == "ready") manager_.Ready();
    if (verb == "status") manager_.Status(argument);
    if (verb == "wait") Live(std::chrono::hours(1));
    if (verb == "alive") Live(std::chrono::milliseconds(number));
    if (verb == "hang") Hang();
    if (verb == "exit") ::_exit(number);
    if (verb == "ignore-term") ignores_term_ = true;
    if (verb == "fork") Fork();
    if (verb == "describe") Describe();
    if (verb == "grow") Grow(static_cast<std::size_t>(number) << 20);
  }

 private:
  void Log(std::string_view what) const {
    const std::string line = fmt::format("{} {}\n", name_, what);
    static_cast<void>(::write(log_.get(), line.data(), line.size()) > 0);
  }

  void Live(Duration duration) {
    const MonotonicTime end = MonotonicClock::now() + duration;
    while (MonotonicClock::now() < end) {
      manager_.Watchdog();
      const timespec step{.tv_sec = 0, .tv_nsec = 10'000'000};
      if (::sigtimedwait(&term_, nullptr, &step) == SIGTERM && !ignores_term_) {
        Log("term");
        ::_exit(0);
      }
    }
  }

  static void Hang() {
    while (true)
      ::pause();
  }

  void Fork() const {
    const pid_t pid = ::fork();
    if (pid == 0) Hang();  // SIGTERM is blocked
    Log(fmt::format("grandchild {}", pid));
  }

  static std::int64_t RealTimeRunUs() {
    rlimit limit{};
    ::getrlimit(RLIMIT_RTTIME, &limit);
    return static_cast<std::int64_t>(limit.rlim_cur);
  }

  void Describe() const {
    int death_signal = 0;
    ::prctl(PR_GET_PDEATHSIG, &death_signal);
    int open_files = 0;
    for (int fd = 3; fd < 256; ++fd) {
      if (fd != log_.get() && (::fcntl(fd, F_GETFD) & FD_CLOEXEC) == 0) ++open_files;
    }
    char stdin_byte = 0;
    Log(
        fmt::format("group_leader={} death_signal={} blocked_term={} open_files={} stdin={} "
                    "nice={} fifo={} real_time_run_us={}",
                    ::getpgrp() == ::getpid(),
                    death_signal,
                    ::sigismember(&inherited_, SIGTERM),
                    open_files,
                    ::read(STDIN_FILENO, &stdin_byte, 1),
                    ::getpriority(PRIO_PROCESS, 0),
                    ::sched_getscheduler(0) == SCHED_FIFO,
                    RealTimeRunUs()));
  }

  void Grow(std::size_t bytes) { memory_.assign(bytes, 'x'); }

  std::string name_;
  UniqueFd log_;
  ServiceManager manager_;
  sigset_t term_{};
  sigset_t inherited_{};
  bool ignores_term_ = false;
  std::vector<char> memory_;
};

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  relocd::TestChild child(argv[1], argv[2]);
  for (int i = 3; i < argc; ++i)
    child.Do(argv[i]);
  return 0;
}
