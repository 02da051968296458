#include "relocd/supervisor_node.h"

#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "messaging/in_process_bus.h"

namespace relocd {
namespace {

using namespace std::chrono_literals;

class SupervisorNodeTest : public testing::Test {
 protected:
  SupervisorNodeTest() {
    bus_.Subscribe<supervisor_t>(
        channels::kSupervisor, Delivery::kEvery, [this](const auto& m) { tables_.push_back(m); });
    bus_.Subscribe<config_t>(
        channels::kConfig, Delivery::kEvery, [this](const auto& m) { configs_.push_back(m); });
    bus_.Subscribe<timesync_t>(
        channels::kTimesync, Delivery::kEvery, [this](const auto& m) { timesyncs_.push_back(m); });
  }

  void PublishAt(Duration since_start, std::int64_t changes = 0, std::int64_t wall_step_us = 0) {
    const ClockReading now{.monotonic = MonotonicTime(1000s) + since_start,
                           .realtime_us = 1'700'000'000'000'000 + since_start / 1us + wall_step_us};
    EXPECT_TRUE(node_.Publish(&bus_, reports_, changes, now));
    bus_.HandlePending();
  }

  InProcessBus bus_;
  SupervisorNode node_{{.version = "0.1.0", .hash = "abc", .yaml = "bus:\n"}, 77};
  std::vector<ProcessReport> reports_{{.name = "odometryd",
                                       .state = ProcessState::kReady,
                                       .pid = 12,
                                       .restarts = 3,
                                       .last_exit_code = 137,
                                       .resident_bytes = 1000,
                                       .status_text = "100 Hz"}};
  std::vector<supervisor_t> tables_;
  std::vector<config_t> configs_;
  std::vector<timesync_t> timesyncs_;
};

TEST_F(SupervisorNodeTest, PublishesAllThreeAtItsStart) {
  PublishAt(0s);
  ASSERT_EQ(tables_.size(), 1U);
  EXPECT_EQ(tables_[0].utime, 1'700'000'000'000'000);
  EXPECT_EQ(tables_[0].mono_ns, 1'000'000'000'000);
  EXPECT_EQ(tables_[0].run_id, 77);
  EXPECT_EQ(tables_[0].n, 1);
  EXPECT_EQ(tables_[0].processes[0].name, "odometryd");
  EXPECT_EQ(tables_[0].processes[0].state, process_t::READY);
  EXPECT_EQ(tables_[0].processes[0].pid, 12);
  EXPECT_EQ(tables_[0].processes[0].restarts, 3);
  EXPECT_EQ(tables_[0].processes[0].last_exit_code, 137);
  EXPECT_EQ(tables_[0].processes[0].rss_bytes, 1000);
  EXPECT_EQ(tables_[0].processes[0].status_text, "100 Hz");
  ASSERT_EQ(configs_.size(), 1U);
  EXPECT_EQ(configs_[0].yaml, "bus:\n");
  EXPECT_EQ(configs_[0].hash, "abc");
  ASSERT_EQ(timesyncs_.size(), 1U);
  EXPECT_EQ(timesyncs_[0].step_ns, 0);
}

TEST_F(SupervisorNodeTest, PublishesEachAtItsRate) {
  for (Duration time = 0s; time < 20s; time += 250ms)
    PublishAt(time);
  EXPECT_EQ(tables_.size(), 40U);
  EXPECT_EQ(timesyncs_.size(), 20U);
  EXPECT_EQ(configs_.size(), 2U);
  for (std::size_t i = 0; i < tables_.size(); ++i)
    EXPECT_EQ(tables_[i].seq, static_cast<std::int64_t>(i));
}

TEST_F(SupervisorNodeTest, PublishesTheTableAtOnceWhenItChanged) {
  PublishAt(0s, 0);
  PublishAt(10ms, 0);
  EXPECT_EQ(tables_.size(), 1U);
  PublishAt(20ms, 1);
  EXPECT_EQ(tables_.size(), 2U);
}

TEST_F(SupervisorNodeTest, PublishesAChangedConfigAtOnce) {
  PublishAt(0s);
  node_.SetConfig({.version = "0.1.0", .hash = "def", .yaml = "bus: {}\n"});
  PublishAt(10ms);
  ASSERT_EQ(configs_.size(), 2U);
  EXPECT_EQ(configs_[1].hash, "def");
  EXPECT_EQ(configs_[1].seq, 1);
}

TEST_F(SupervisorNodeTest, SaysHowFarTheWallClockWasStepped) {
  PublishAt(0s);
  PublishAt(1s, 0, 3'600'000'000);
  PublishAt(2s, 0, 3'600'000'000);
  ASSERT_EQ(timesyncs_.size(), 3U);
  EXPECT_EQ(timesyncs_[1].step_ns, 3'600'000'000'000);
  EXPECT_EQ(timesyncs_[2].step_ns, 0);
}

TEST_F(SupervisorNodeTest, DoesNothingWithoutABus) {
  EXPECT_TRUE(node_.Publish(nullptr, reports_, 0, {}));
}

TEST(SummarizeTest, NamesWhoIsNotReadyAndWhy) {
  const std::vector<ProcessReport> reports{
      {.name = "odometryd", .state = ProcessState::kReady},
      {.name = "inferenced", .state = ProcessState::kBackoff, .last_exit_code = 137},
      {.name = "camerad_front", .state = ProcessState::kStarting}};
  EXPECT_EQ(Summarize(reports),
            "1/3 ready; inferenced BACKOFF (exit code 137); camerad_front STARTING");
}

TEST(IsEssentialReadyTest, WaitsForOdometryAndSmoother) {
  const auto of = [](ProcessState odometry, ProcessState smoother) {
    return IsEssentialReady({{.name = "odometryd", .state = odometry},
                             {.name = "smootherd", .state = smoother},
                             {.name = "camerad_front", .state = ProcessState::kBackoff}});
  };
  EXPECT_TRUE(of(ProcessState::kReady, ProcessState::kReady));
  EXPECT_TRUE(of(ProcessState::kReady, ProcessState::kFailed));
  EXPECT_FALSE(of(ProcessState::kReady, ProcessState::kStarting));
  EXPECT_FALSE(of(ProcessState::kBackoff, ProcessState::kReady));
}

}  // namespace
}  // namespace relocd
