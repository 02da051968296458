#include "supervision/supervisor.h"

#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

/// Real children under a real supervisor, with short times.
class SupervisorTest : public testing::Test {
 protected:
  SupervisorTest() {
    auto supervisor =
        Supervisor::Create({.backoff_initial = 30ms,
                            .abort_timeout = 300ms,
                            .period = 20ms,
                            .environment = {"RELOCD_PLAYBACK_EPOCH_NS=7"},
                            .on_event = [this](int /*priority*/, const std::string& text) {
                              events_ += text + "\n";
                            }});
    EXPECT_TRUE(supervisor);
    supervisor_.emplace(std::move(supervisor).value());
  }

  ProcessSpec Child(const std::string& name, const std::vector<std::string>& steps) const {
    ProcessSpec spec{.name = name, .config = {}, .settings = {}};
    spec.config.command = {RELOCD_TEST_CHILD, name, log_};
    spec.config.command.insert(spec.config.command.end(), steps.begin(), steps.end());
    spec.config.watchdog_s = 2.0;
    spec.config.stop_timeout_s = 1.0;
    return spec;
  }

  void Apply(const std::vector<ProcessSpec>& table) {
    supervisor_->Apply(table, MonotonicClock::now());
  }

  /// Runs the supervisor's loop. @return how long it took; fails the test after 5 s.
  Duration RunUntil(const std::function<bool()>& is_done) {
    const MonotonicTime begin = MonotonicClock::now();
    while (!is_done()) {
      if (MonotonicClock::now() - begin > 5s) {
        ADD_FAILURE() << "took too long; events:\n" << events_;
        break;
      }
      pollfd ready{.fd = supervisor_->fd(), .events = POLLIN, .revents = 0};
      ::poll(&ready, 1, 100);
      supervisor_->Handle(MonotonicClock::now());
    }
    return MonotonicClock::now() - begin;
  }

  [[nodiscard]] ProcessReport Report(const std::string& name) const {
    for (ProcessReport& report : supervisor_->Reports(MonotonicClock::now())) {
      if (report.name == name) return report;
    }
    return {};
  }

  [[nodiscard]] bool Is(const std::string& name, ProcessState state) const {
    const ProcessReport report = Report(name);
    return report.name == name && report.state == state;
  }

  [[nodiscard]] bool AreReady(const std::vector<std::string>& names) const {
    return std::all_of(names.begin(), names.end(), [&](const std::string& name) {
      return Is(name, ProcessState::kReady);
    });
  }

  [[nodiscard]] std::string Log() const {
    auto text = ReadFile(log_);
    return text ? *text : "";
  }

  TemporaryFolder folder_;
  std::string log_ = folder_.path() + "/log";
  std::string events_;
  std::optional<Supervisor> supervisor_;
};

TEST_F(SupervisorTest, StartsAChildAndReportsHowItIs) {
  Apply({Child("camera", {"status:30.0 Hz", "ready", "wait"})});
  RunUntil([&] { return AreReady({"camera"}); });
  const ProcessReport report = Report("camera");
  EXPECT_GT(report.pid, 1);
  EXPECT_EQ(report.restarts, 0);
  EXPECT_EQ(report.last_exit_code, -1);
  EXPECT_EQ(report.status_text, "30.0 Hz");
  RunUntil([&] { return Report("camera").resident_bytes > 100'000; });
}

TEST_F(SupervisorTest, StartsEachAfterThoseItComesAfter) {
  ProcessSpec second = Child("second", {"ready", "wait"});
  second.config.after = {"first"};
  ProcessSpec third = Child("third", {"ready", "wait"});
  third.config.after = {"first", "second"};
  Apply({third, second, Child("first", {"alive:60", "ready", "wait"})});
  RunUntil([&] { return AreReady({"first", "second", "third"}); });
  EXPECT_EQ(Log(), "first start\nsecond start\nthird start\n");
}

TEST_F(SupervisorTest, StartsWithoutADependencyThatTakesTooLong) {
  ProcessSpec slow = Child("slow", {"wait"});  // never says READY
  slow.config.start_timeout_s = 0.15;
  ProcessSpec dependent = Child("dependent", {"ready", "wait"});
  dependent.config.after = {"slow"};
  Apply({slow, dependent});
  const Duration waited = RunUntil([&] { return AreReady({"dependent"}); });
  EXPECT_GE(waited, 140ms);
  EXPECT_TRUE(Is("slow", ProcessState::kStarting)) << "gives signs of life, so is left alone";
}

TEST_F(SupervisorTest, StartsAtOnceWithoutADependencyThatFailed) {
  ProcessSpec dependent = Child("dependent", {"ready", "wait"});
  dependent.config.after = {"broken"};
  Apply({Child("broken", {"exit:78"}), dependent});
  EXPECT_LT(RunUntil([&] { return AreReady({"dependent"}); }), 1s);
}

TEST_F(SupervisorTest, RestartsAChildThatWasKilledInTwoTenthsOfASecond) {
  // With the field's back-off, each time anew.
  auto supervisor = Supervisor::Create({.backoff_reset = 1ms, .environment = {}, .on_event = {}});
  ASSERT_TRUE(supervisor);
  supervisor_.emplace(std::move(supervisor).value());
  Apply({Child("odometry", {"ready", "wait"})});
  RunUntil([&] { return AreReady({"odometry"}); });
  Duration shortest = 1h;  // of a few: other processes may hold us up
  for (int kills = 1; kills <= 10 && shortest >= 200ms; ++kills) {
    const int pid = Report("odometry").pid;
    ::kill(pid, SIGKILL);
    const Duration down =
        RunUntil([&] { return AreReady({"odometry"}) && Report("odometry").pid != pid; });
    EXPECT_GE(down, 100ms) << "the back-off";
    EXPECT_EQ(Report("odometry").restarts, kills);
    EXPECT_EQ(Report("odometry").last_exit_code, 137);
    shortest = std::min(shortest, down);
  }
  EXPECT_LT(shortest, 200ms);
}

TEST_F(SupervisorTest, BacksOffFromAChildThatEndsAgainAndAgain) {
  Apply({Child("flaky", {"exit:1"})});
  RunUntil([&] { return Report("flaky").restarts >= 3; });
  EXPECT_THAT(events_, HasSubstr("flaky: ended with exit code 1, starts again in 0.0 s"));
  EXPECT_THAT(events_, HasSubstr("flaky: ended with exit code 1, starts again in 0.1 s"));
}

TEST_F(SupervisorTest, DoesNotRetryABadConfigBeforeAReload) {
  const ProcessSpec broken = Child("broken", {"exit:78"});
  Apply({broken});
  RunUntil([&] { return Is("broken", ProcessState::kFailed); });
  const MonotonicTime later = MonotonicClock::now() + 300ms;
  RunUntil([&] { return MonotonicClock::now() > later; });
  EXPECT_EQ(Log(), "broken start\n");
  EXPECT_THAT(events_, HasSubstr("broken: exit code 78 says that its input is wrong"));

  Apply({broken});
  RunUntil([&] { return Log() == "broken start\nbroken start\n"; });
}

TEST_F(SupervisorTest, CallsAMissingProgramFailedAndNamesIt) {
  ProcessSpec missing = Child("missing", {});
  missing.config.command = {"/nowhere/missing"};
  Apply({missing});
  RunUntil([&] { return Is("missing", ProcessState::kFailed); });
  EXPECT_EQ(Report("missing").status_text, "starting /nowhere/missing: No such file or directory");
}

TEST_F(SupervisorTest, AbortsAChildThatHangs) {
  ProcessSpec hanging = Child("hanging", {"ready", "alive:50", "hang"});
  hanging.config.watchdog_s = 0.2;
  Apply({hanging});
  RunUntil([&] { return Report("hanging").restarts == 1; });
  EXPECT_EQ(Report("hanging").last_exit_code, 128 + SIGABRT);
  EXPECT_THAT(events_, HasSubstr("hanging: gave no sign of life for 0."));
}

TEST_F(SupervisorTest, EndsAChildThatWasStopped) {
  ProcessSpec frozen = Child("frozen", {"ready", "wait"});
  frozen.config.watchdog_s = 0.2;
  Apply({frozen});
  RunUntil([&] { return AreReady({"frozen"}); });
  ::kill(Report("frozen").pid, SIGSTOP);
  RunUntil([&] { return Report("frozen").restarts == 1; });
}

TEST_F(SupervisorTest, DoesNotCallAChildHungWhenItWasLateItself) {
  ProcessSpec child = Child("child", {"ready", "alive:100", "hang"});
  child.config.watchdog_s = 0.3;
  Apply({child});
  RunUntil([&] { return AreReady({"child"}); });
  const MonotonicTime now = MonotonicClock::now();
  supervisor_->Handle(now + 5s);  // as after 5 s without the CPU
  EXPECT_TRUE(AreReady({"child"}));
  EXPECT_THAT(events_, HasSubstr("this supervisor did not run for 5"));
  supervisor_->Handle(now + 5s + 290ms);
  EXPECT_TRUE(AreReady({"child"}));
}

TEST_F(SupervisorTest, StopsTierByTierTheRecorderLast) {
  ProcessSpec camera = Child("camera", {"ready", "wait"});
  ProcessSpec smoother = Child("smoother", {"ready", "wait"});
  smoother.config.stop_tier = 1;
  ProcessSpec recorder = Child("recorder", {"ready", "wait"});
  recorder.config.stop_tier = 2;
  Apply({recorder, smoother, camera});
  RunUntil([&] { return AreReady({"camera", "smoother", "recorder"}); });
  supervisor_->Stop(MonotonicClock::now());
  std::vector<std::string> ended;
  RunUntil([&] {
    for (const ProcessReport& report : supervisor_->Reports(MonotonicClock::now())) {
      const bool is_new = std::find(ended.begin(), ended.end(), report.name) == ended.end();
      if (report.state == ProcessState::kStopped && is_new) ended.push_back(report.name);
    }
    return supervisor_->has_stopped();
  });
  EXPECT_THAT(ended, ElementsAre("camera", "smoother", "recorder"));
}

TEST_F(SupervisorTest, KillsWhoDoesNotStop) {
  ProcessSpec stubborn = Child("stubborn", {"ignore-term", "ready", "wait"});
  stubborn.config.stop_timeout_s = 0.2;
  ProcessSpec polite = Child("polite", {"ready", "wait"});
  polite.config.stop_tier = 1;
  Apply({stubborn, polite});
  RunUntil([&] { return AreReady({"stubborn", "polite"}); });
  supervisor_->Stop(MonotonicClock::now());
  const Duration took = RunUntil([&] { return supervisor_->has_stopped(); });
  EXPECT_GE(took, 190ms);
  EXPECT_LT(took, 3s);
  EXPECT_EQ(Report("stubborn").last_exit_code, 128 + SIGKILL);
  EXPECT_EQ(Report("polite").last_exit_code, 0);
}

TEST_F(SupervisorTest, StartsNobodyAgainWhileItStops) {
  ProcessSpec recorder = Child("recorder", {"ready", "wait"});
  recorder.config.stop_tier = 1;
  ProcessSpec stubborn = Child("stubborn", {"ignore-term", "ready", "wait"});
  stubborn.config.stop_timeout_s = 0.3;
  Apply({recorder, stubborn, Child("flaky", {"exit:1"})});
  RunUntil([&] { return AreReady({"recorder", "stubborn"}); });
  supervisor_->Stop(MonotonicClock::now());
  ::kill(Report("recorder").pid, SIGKILL);
  RunUntil([&] { return supervisor_->has_stopped(); });
  EXPECT_EQ(Report("recorder").restarts, 0);
}

TEST_F(SupervisorTest, ReloadsOnlyWhatChanged) {
  const ProcessSpec same = Child("same", {"ready", "wait"});
  ProcessSpec changed = Child("changed", {"ready", "wait"});
  changed.settings = "wheel_radius_m: 0.10";
  Apply({same, changed, Child("removed", {"ready", "wait"})});
  RunUntil([&] { return AreReady({"same", "changed", "removed"}); });
  const int same_pid = Report("same").pid;
  const int changed_pid = Report("changed").pid;

  changed.settings = "wheel_radius_m: 0.11";
  ProcessSpec patient = same;
  patient.config.stop_timeout_s = 1.5;  // concerns the supervisor only
  Apply({patient, changed, Child("added", {"ready", "wait"})});
  RunUntil([&] {
    return AreReady({"same", "changed", "added"}) && Report("changed").pid != changed_pid &&
           Report("removed").name.empty();
  });
  EXPECT_EQ(Report("same").pid, same_pid);
  EXPECT_EQ(Report("changed").restarts, 1);
  EXPECT_EQ(Report("changed").last_exit_code, 0) << "asked to end, not killed";
}

TEST_F(SupervisorTest, RestartsAChildThatGrewTooBig) {
  ProcessSpec big = Child("big", {"ready", "grow:64", "wait"});
  big.config.rss_limit_mb = 40.0;
  Apply({big});
  RunUntil([&] { return Report("big").restarts == 1; });
  EXPECT_THAT(events_, HasSubstr("MB of resident memory, may have 40: restarting it"));
}

TEST_F(SupervisorTest, CountsEachChangeOfState) {
  Apply({Child("child", {"ready", "wait"})});
  const std::int64_t before = supervisor_->changes();
  RunUntil([&] { return AreReady({"child"}); });
  EXPECT_EQ(supervisor_->changes() - before, 2) << "starting, ready";
}

}  // namespace
}  // namespace relocd
