#include "supervision/restart_policy.h"

#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using namespace std::chrono_literals;
using Kind = RestartEventKind;
using Action = RestartAction;
using State = ProcessState;

constexpr MonotonicTime kStart{1000s};

RestartState In(State state) {
  RestartState restart_state;
  restart_state.state = state;
  restart_state.entered = kStart;
  restart_state.started = kStart;
  if (state == State::kStarting) restart_state.deadline = kStart + 10s;
  if (state != State::kStarting && state != State::kWaiting) restart_state.deadline = kStart + 2s;
  if (state == State::kStopped || state == State::kFailed) restart_state.deadline = kNever;
  return restart_state;
}

struct TransitionCase {
  std::string name;
  State state;
  RestartEvent event;
  Duration after;  ///< Since the state was entered.
  State next;
  Action action;
};

class TransitionTest : public testing::TestWithParam<TransitionCase> {};

TEST_P(TransitionTest, GivesTheStateAndTheAction) {
  const TransitionCase& c = GetParam();
  const auto transition = Advance(In(c.state), c.event, kStart + c.after, RestartLimits{});
  EXPECT_EQ(NameOf(transition.next.state), NameOf(c.next));
  EXPECT_EQ(transition.action, c.action);
}

RestartEvent Exit(int code) {
  return {.kind = Kind::kExited, .exit_code = code};
}
RestartEvent Of(Kind kind) {
  return {.kind = kind};
}

const std::vector<TransitionCase> kTransitions{
    {"WaitingStartsWhenItsDependenciesAreThere",
     State::kWaiting,
     Of(Kind::kDependenciesMet),
     0s,
     State::kStarting,
     Action::kStart},
    {"WaitingWaits", State::kWaiting, Of(Kind::kTick), 100s, State::kWaiting, Action::kNone},
    {"WaitingIsStopped", State::kWaiting, Of(Kind::kStop), 0s, State::kStopped, Action::kNone},
    {"StartingBecomesReady", State::kStarting, Of(Kind::kReady), 1s, State::kReady, Action::kNone},
    {"StartingMayLoadForLong",
     State::kStarting,
     Of(Kind::kTick),
     9s,
     State::kStarting,
     Action::kNone},
    {"StartingHangs", State::kStarting, Of(Kind::kTick), 10s, State::kStopping, Action::kAbort},
    {"StartingEnds", State::kStarting, Exit(1), 1s, State::kBackoff, Action::kNone},
    {"StartingHasABadConfig", State::kStarting, Exit(78), 1s, State::kFailed, Action::kNone},
    {"ReadyIsReadyAgain", State::kReady, Of(Kind::kReady), 1s, State::kReady, Action::kNone},
    {"ReadyIsKilled", State::kReady, Exit(137), 1s, State::kBackoff, Action::kNone},
    {"ReadyEndsWithoutBeingAsked", State::kReady, Exit(0), 1s, State::kBackoff, Action::kNone},
    {"ReadyIsAlive", State::kReady, Of(Kind::kTick), 1999ms, State::kReady, Action::kNone},
    {"ReadyHangs", State::kReady, Of(Kind::kTick), 2s, State::kStopping, Action::kAbort},
    {"ReadySaysThatItHangs", State::kReady, Of(Kind::kHung), 1s, State::kStopping, Action::kAbort},
    {"ReadySaysThatItEnds", State::kReady, Of(Kind::kEnding), 1s, State::kStopping, Action::kNone},
    {"ReadyIsStopped", State::kReady, Of(Kind::kStop), 1s, State::kStopping, Action::kTerminate},
    {"ReadyHasANewConfig",
     State::kReady,
     Of(Kind::kRestart),
     1s,
     State::kStopping,
     Action::kTerminate},
    {"ReadyIsNotTouchedByAReload",
     State::kReady,
     Of(Kind::kReload),
     1s,
     State::kReady,
     Action::kNone},
    {"BackoffWaits", State::kBackoff, Of(Kind::kTick), 1s, State::kBackoff, Action::kNone},
    {"BackoffIsOver", State::kBackoff, Of(Kind::kTick), 2s, State::kStarting, Action::kStart},
    {"BackoffIsCutShortByAReload",
     State::kBackoff,
     Of(Kind::kReload),
     1s,
     State::kStarting,
     Action::kStart},
    {"BackoffIsStopped", State::kBackoff, Of(Kind::kStop), 1s, State::kStopped, Action::kNone},
    {"StoppingHasTime", State::kStopping, Of(Kind::kTick), 1999ms, State::kStopping, Action::kNone},
    {"StoppingIsKilled",
     State::kStopping,
     Of(Kind::kTick),
     2s,
     State::kStopping,
     Action::kKillGroup},
    {"StoppingWasHungAndStartsAgain",
     State::kStopping,
     Exit(134),
     1s,
     State::kBackoff,
     Action::kNone},
    {"StoppingIsNotWantedAnyLonger",
     State::kStopping,
     Of(Kind::kStop),
     1s,
     State::kStopping,
     Action::kTerminate},
    {"FailedStays", State::kFailed, Of(Kind::kTick), 3600s, State::kFailed, Action::kNone},
    {"FailedIsTriedAgainAfterAReload",
     State::kFailed,
     Of(Kind::kReload),
     1s,
     State::kWaiting,
     Action::kNone},
    {"StoppedStays", State::kStopped, Of(Kind::kTick), 3600s, State::kStopped, Action::kNone},
    {"StoppedIsWantedAgain",
     State::kStopped,
     Of(Kind::kReload),
     1s,
     State::kWaiting,
     Action::kNone},
    {"StoppedHearsNoReady", State::kStopped, Of(Kind::kReady), 1s, State::kStopped, Action::kNone},
};

INSTANTIATE_TEST_SUITE_P(Table,
                         TransitionTest,
                         testing::ValuesIn(kTransitions),
                         [](const auto& instance) { return instance.param.name; });

TEST(RestartPolicyTest, DoublesTheBackOffUpToItsLimit) {
  RestartState state = In(State::kReady);
  MonotonicTime now = kStart;
  for (const Duration expected :
       std::vector<Duration>{100ms, 200ms, 400ms, 800ms, 1600ms, 3200ms, 5s, 5s}) {
    state = Advance(state, Exit(1), now, RestartLimits{}).next;
    EXPECT_EQ(state.deadline - now, expected);
    now = state.deadline;
    state = Advance(state, Of(Kind::kTick), now, RestartLimits{}).next;
    EXPECT_EQ(state.state, State::kStarting);
  }
}

TEST(RestartPolicyTest, BeginsWithTheShortBackOffAgainAfterALongLife) {
  RestartState state = In(State::kReady);
  state.backoff = 3200ms;
  EXPECT_EQ(Advance(state, Exit(1), kStart + 29s, RestartLimits{}).next.backoff, 5s);
  EXPECT_EQ(Advance(state, Exit(1), kStart + 30s, RestartLimits{}).next.backoff, 100ms);
}

TEST(RestartPolicyTest, GivesEachSignOfLifeAnotherPeriod) {
  const RestartState before = In(State::kReady);
  const auto after = Advance(before, Of(Kind::kAlive), kStart + 1500ms, RestartLimits{}).next;
  EXPECT_EQ(after.deadline, kStart + 3500ms);
}

TEST(RestartPolicyTest, ExpectsSignsOfLifeOfAStartingChildOnceItGaveOne) {
  const auto after =
      Advance(In(State::kStarting), Of(Kind::kAlive), kStart + 1s, RestartLimits{}).next;
  EXPECT_EQ(after.state, State::kStarting);
  EXPECT_EQ(after.deadline, kStart + 3s);
}

TEST(RestartPolicyTest, GrantsAnExtensionButNeverShortensTheTimeLeft) {
  const RestartState starting = In(State::kStarting);
  const auto extend = [&](Duration extension) {
    const RestartEvent event{.kind = Kind::kExtend, .extension = extension};
    return Advance(starting, event, kStart + 1s, RestartLimits{}).next.deadline - kStart;
  };
  EXPECT_EQ(extend(60s), 61s);
  EXPECT_EQ(extend(1s), 10s);
  EXPECT_EQ(extend(-5s), 10s);
  EXPECT_EQ(extend(Duration::max() / 2), 601s) << "ten minutes at most";
}

TEST(RestartPolicyTest, DoesNotBlameTheChildForALateSupervisor) {
  const RestartState ready = In(State::kReady);
  const auto after = Advance(ready, Of(Kind::kSupervisorLate), kStart + 5s, RestartLimits{}).next;
  EXPECT_EQ(Advance(after, Of(Kind::kTick), kStart + 6900ms, RestartLimits{}).action,
            Action::kNone);
  EXPECT_EQ(Advance(after, Of(Kind::kTick), kStart + 7s, RestartLimits{}).action, Action::kAbort);
}

TEST(RestartPolicyTest, NeverCallsAnUnwatchedChildHung) {
  const RestartLimits unwatched{.watchdog = 0s};
  RestartState state =
      Advance(In(State::kWaiting), Of(Kind::kDependenciesMet), kStart, unwatched).next;
  EXPECT_EQ(state.state, State::kReady) << "nor is it waited for";
  EXPECT_EQ(Advance(state, Of(Kind::kTick), kStart + 3600s, unwatched).action, Action::kNone);
}

TEST(RestartPolicyTest, StaysStoppedWhenItWasNotWanted) {
  const auto stopping = Advance(In(State::kReady), Of(Kind::kStop), kStart, RestartLimits{}).next;
  EXPECT_EQ(Advance(stopping, Exit(0), kStart + 1s, RestartLimits{}).next.state, State::kStopped);
  EXPECT_EQ(Advance(stopping, Exit(78), kStart + 1s, RestartLimits{}).next.state, State::kStopped);
}

TEST(RestartPolicyTest, StartsAtOnceWithANewConfig) {
  const auto stopping =
      Advance(In(State::kReady), Of(Kind::kRestart), kStart, RestartLimits{}).next;
  const auto after = Advance(stopping, Exit(0), kStart + 1s, RestartLimits{});
  EXPECT_EQ(after.next.state, State::kStarting);
  EXPECT_EQ(after.action, Action::kStart);
  EXPECT_FALSE(after.next.restarts_at_once);
}

TEST(RestartPolicyTest, KillsAgainWhoDoesNotDie) {
  RestartState state = In(State::kStopping);
  state = Advance(state, Of(Kind::kTick), kStart + 2s, RestartLimits{}).next;
  EXPECT_EQ(Advance(state, Of(Kind::kTick), kStart + 2900ms, RestartLimits{}).action,
            Action::kNone);
  EXPECT_EQ(Advance(state, Of(Kind::kTick), kStart + 3s, RestartLimits{}).action,
            Action::kKillGroup);
}

TEST(RestartPolicyTest, NeverHasADeadlineWithoutAnActionWhenItComes) {
  // Else the supervisor's timer would fire without end.
  for (const TransitionCase& c : kTransitions) {
    const auto after = Advance(In(c.state), c.event, kStart + c.after, RestartLimits{}).next;
    if (after.deadline == kNever) continue;
    EXPECT_NE(Advance(after, Of(Kind::kTick), after.deadline, RestartLimits{}).action,
              Action::kNone)
        << c.name;
  }
}

}  // namespace
}  // namespace relocd
