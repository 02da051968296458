#include "supervision/child_process.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "core/parse_number.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

class ChildProcessTest : public testing::Test {
 protected:
  [[nodiscard]] LaunchOptions TestChild(std::vector<std::string> steps) const {
    LaunchOptions options{.command = {RELOCD_TEST_CHILD, "child", log_}};
    options.command.insert(options.command.end(), steps.begin(), steps.end());
    return options;
  }

  static int WaitForEnd(ChildProcess& child) {
    pollfd ready{.fd = child.fd(), .events = POLLIN, .revents = 0};
    EXPECT_EQ(::poll(&ready, 1, 5000), 1) << "the child did not end";
    return child.Reap().value_or(-1);
  }

  [[nodiscard]] std::string Log() const {
    auto text = ReadFile(log_);
    return text ? *text : "";
  }

  TemporaryFolder folder_;
  std::string log_ = folder_.path() + "/log";
};

TEST_F(ChildProcessTest, GivesTheExitCode) {
  auto child = ChildProcess::Start(TestChild({"exit:78"}));
  ASSERT_TRUE(child);
  EXPECT_EQ(WaitForEnd(*child), 78);
  EXPECT_EQ(child->Reap(), std::nullopt);
}

TEST_F(ChildProcessTest, GivesTheSignal) {
  auto child = ChildProcess::Start(TestChild({"hang"}));
  ASSERT_TRUE(child);
  EXPECT_EQ(child->Reap(), std::nullopt);
  EXPECT_GT(child->ResidentBytes(), 0);
  child->Signal(SIGKILL);
  EXPECT_EQ(WaitForEnd(*child), 128 + SIGKILL);
}

TEST_F(ChildProcessTest, StartsInAGroupOfItsOwnAndInheritsNothing) {
  const UniqueFd leak(::open("/dev/null", O_RDONLY));  // without O_CLOEXEC, as a library might
  sigset_t term;
  ::sigemptyset(&term);
  ::sigaddset(&term, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &term, nullptr);
  auto child = ChildProcess::Start(TestChild({"describe"}));
  ::pthread_sigmask(SIG_UNBLOCK, &term, nullptr);
  ASSERT_TRUE(child);
  EXPECT_EQ(WaitForEnd(*child), 0);
  EXPECT_THAT(Log(),
              HasSubstr("group_leader=true death_signal=9 blocked_term=0 open_files=0 stdin=0"));
}

TEST_F(ChildProcessTest, IsScheduledAsAskedOrSaysWhyNot) {
  LaunchOptions options = TestChild({"describe"});
  options.nice = 7;
  options.is_real_time = true;
  options.priority = 20;
  auto child = ChildProcess::Start(options);
  ASSERT_TRUE(child);
  EXPECT_EQ(WaitForEnd(*child), 0);
  EXPECT_THAT(Log(), HasSubstr("nice=7"));
  // Far above the watchdog: a search for memory on its behalf is no endless loop.
  EXPECT_THAT(Log(), HasSubstr("real_time_run_us=10000000"));
  if (child->warning().empty()) {
    EXPECT_THAT(Log(), HasSubstr("fifo=true"));
  } else {
    EXPECT_THAT(child->warning(), HasSubstr("SCHED_FIFO 20 is refused: "));
    EXPECT_THAT(Log(), HasSubstr("fifo=false"));
  }
}

TEST_F(ChildProcessTest, NamesTheProgramThatIsNotThere) {
  const auto child = ChildProcess::Start({.command = {"/nowhere/odometryd"}});
  ASSERT_FALSE(child);
  EXPECT_EQ(child.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(child.error().message, "starting /nowhere/odometryd: No such file or directory");
}

TEST_F(ChildProcessTest, RefusesAFileThatIsNoProgram) {
  const auto child = ChildProcess::Start({.command = {"/etc/passwd"}});
  ASSERT_FALSE(child);
  EXPECT_EQ(child.error().message, "starting /etc/passwd: Permission denied");
}

/// Waits, as nobody tells when a process that is not our child ends.
bool EndsSoon(pid_t pid) {
  for (int i = 0; i < 1000; ++i) {
    auto status = ReadFile("/proc/" + std::to_string(pid) + "/stat");
    if (!status || status->find(") Z ") != std::string::npos) return true;
    ::poll(nullptr, 0, 2);
  }
  return false;
}

TEST_F(ChildProcessTest, TakesItsGroupAlongWhenItEnds) {
  auto child = ChildProcess::Start(TestChild({"fork", "exit:1"}));
  ASSERT_TRUE(child);
  EXPECT_EQ(WaitForEnd(*child), 1);
  const std::string log = Log();
  const std::size_t at = log.find("grandchild ");
  ASSERT_NE(at, std::string::npos) << log;
  const auto grandchild = ParseInt64(log.substr(at + 11, log.find('\n', at) - at - 11));
  ASSERT_TRUE(grandchild);
  EXPECT_TRUE(EndsSoon(static_cast<pid_t>(*grandchild)));
}

TEST_F(ChildProcessTest, EndsWithTheProcessThatStartedIt) {
  const pid_t parent = ::fork();
  if (parent == 0) {
    auto child = ChildProcess::Start(TestChild({"hang"}));
    const std::string pid = std::to_string(child ? child->pid() : 0);
    static_cast<void>(WriteFileAtomically(log_ + ".pid", pid).has_value());
    ::kill(::getpid(), SIGKILL);
  }
  ::waitpid(parent, nullptr, 0);
  const auto pid = ReadFile(log_ + ".pid");
  ASSERT_TRUE(pid);
  EXPECT_TRUE(EndsSoon(static_cast<pid_t>(ParseInt64(*pid).value_or(1))));
}

TEST_F(ChildProcessTest, EndsWithItsObject) {
  pid_t pid = 0;
  {
    auto child = ChildProcess::Start(TestChild({"ignore-term", "wait"}));
    ASSERT_TRUE(child);
    pid = child->pid();
  }
  EXPECT_EQ(::kill(pid, 0), -1);
  EXPECT_EQ(errno, ESRCH);
}

}  // namespace
}  // namespace relocd
