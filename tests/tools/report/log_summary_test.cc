#include "log_summary.h"

#include <cstdint>
#include <limits>

#include <gtest/gtest.h>

#include "messaging/channels.h"

namespace relocd {
namespace {

TEST(LogSummaryTest, GivesTheAgeOfAMessageFromAnyTime) {
  timesync_t message{};
  message.utime = std::numeric_limits<std::int64_t>::min();
  LogEvent event{.number = 0, .timestamp_us = 1'000'000, .channel = "TIMESYNC", .data = {}};
  event.data.resize(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(event.data.data(), 0, message.getEncodedSize());
  LogSummary summary;
  summary.Add(event);
  EXPECT_NEAR(summary.AgePercentileMs("TIMESYNC", 0.5), 9.22e15, 1e13);
}

}  // namespace
}  // namespace relocd
