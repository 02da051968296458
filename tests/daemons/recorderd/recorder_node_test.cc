#include "recorderd/recorder_node.h"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

ClockReading At(double seconds) {
  return {.monotonic = MonotonicTime(FromSeconds(seconds)), .realtime_us = 0};
}

TEST(RecorderNodeTest, ADiskThatRefusedIsSaidUntilItHasTakenAllForAWhile) {
  const TemporaryFolder folder;
  RecorderConfig config;
  config.directory = folder.path() + "/log";
  RecorderNode node(config, 1, [](const auto&) { return std::int64_t{100'000'000'000}; });
  ASSERT_TRUE(node.Start());
  const std::vector<std::uint8_t> bytes(100);
  node.Handle("BEFORE", bytes, 1);
  EXPECT_EQ(node.Status(At(1.0)).level, status_t::OK);
  ASSERT_TRUE(node.Stop());

  // A file where the folder was: the next segment cannot be made.
  std::filesystem::remove_all(config.directory);
  folder.Write("log", "");
  node.Handle("REFUSED", bytes, 2);
  std::filesystem::remove(config.directory);
  ASSERT_TRUE(node.Start());
  node.Handle("TAKEN", bytes, 3);
  node.Flush();

  const NodeStatus soon = node.Status(At(2.0));
  EXPECT_EQ(soon.level, status_t::ERROR);
  EXPECT_THAT(soon.message, HasSubstr("creating log"));
  EXPECT_THAT(soon.message, HasSubstr("(1 events dropped)"));
  EXPECT_EQ(node.Status(At(6.9)).level, status_t::ERROR);
  EXPECT_EQ(node.Status(At(7.1)).level, status_t::OK);
}

}  // namespace
}  // namespace relocd
