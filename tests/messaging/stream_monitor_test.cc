#include "messaging/stream_monitor.h"

#include <cstdint>
#include <limits>

#include <gtest/gtest.h>

namespace relocd {
namespace {

TEST(StreamMonitorTest, CountsNothingInAWholeStream) {
  StreamMonitor monitor;
  for (int seq = 7; seq < 20; ++seq)
    monitor.Observe({.seq = seq, .run_id = 1});
  EXPECT_EQ(monitor.counters().lost, 0);
  EXPECT_EQ(monitor.counters().repeated, 0);
  EXPECT_EQ(monitor.counters().restarts, 0);
}

TEST(StreamMonitorTest, CountsEachNumberThatIsSkipped) {
  StreamMonitor monitor;
  for (const int seq : {0, 1, 4, 5, 9})
    monitor.Observe({.seq = seq, .run_id = 1});
  EXPECT_EQ(monitor.counters().lost, 2 + 3);
}

TEST(StreamMonitorTest, TellsARepeatedMessageFromALostOne) {
  StreamMonitor monitor;
  for (const int seq : {0, 1, 1, 0, 2})
    monitor.Observe({.seq = seq, .run_id = 1});
  EXPECT_EQ(monitor.counters().repeated, 2);
  EXPECT_EQ(monitor.counters().lost, 0);
}

TEST(StreamMonitorTest, TellsARestartFromALoss) {
  StreamMonitor monitor;
  monitor.Observe({.seq = 100, .run_id = 1});
  monitor.Observe({.seq = 0, .run_id = 2});
  monitor.Observe({.seq = 1, .run_id = 2});
  EXPECT_EQ(monitor.counters().restarts, 1);
  EXPECT_EQ(monitor.counters().lost, 0);
  EXPECT_EQ(monitor.counters().conflicts, 0);
}

TEST(StreamMonitorTest, ReportsTwoPublishersThatTakeTurns) {
  StreamMonitor monitor;
  for (int seq = 0; seq < 10; ++seq) {
    monitor.Observe({.seq = seq, .run_id = 1});
    monitor.Observe({.seq = seq + 500, .run_id = 2});
  }
  EXPECT_EQ(monitor.counters().restarts, 1);
  EXPECT_EQ(monitor.counters().conflicts, 18);
  EXPECT_EQ(monitor.counters().lost, 0);
}

TEST(StreamMonitorTest, TakesAJumpThatNoLossCanMakeForAStreamBegunAnew) {
  constexpr std::int64_t kLowest = std::numeric_limits<std::int64_t>::min();
  constexpr std::int64_t kHighest = std::numeric_limits<std::int64_t>::max();
  StreamMonitor monitor;
  for (const std::int64_t seq : {kLowest, kHighest, kHighest, kLowest})
    monitor.Observe({.seq = seq, .run_id = 1});
  EXPECT_EQ(monitor.counters().lost, 0);
  EXPECT_EQ(monitor.counters().restarts, 1);
  EXPECT_EQ(monitor.counters().repeated, 2);
}

}  // namespace
}  // namespace relocd
