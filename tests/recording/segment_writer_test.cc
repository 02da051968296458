#include "recording/segment_writer.h"

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "recording/log_reader.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

class SegmentWriterTest : public testing::Test {
 protected:
  RecorderConfig MakeConfig() const {
    RecorderConfig config;
    config.directory = temporary_.path() + "/segments";
    config.segment_mb = 1;
    config.max_total_mb = 3;
    config.min_free_mb = 0;
    return config;
  }

  std::vector<fs::path> Files() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(config_.directory))
      files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    return files;
  }

  static std::int64_t CountEvents(const fs::path& path) {
    auto reader = LogReader::Open(path.string());
    while (reader->Next()) {
    }
    EXPECT_EQ(reader->counters().damaged_places, 0) << path;
    return reader->counters().events;
  }

  TemporaryFolder temporary_;
  RecorderConfig config_ = MakeConfig();
  std::vector<std::uint8_t> hundred_kilobytes_ = std::vector<std::uint8_t>(100'000);
};

TEST_F(SegmentWriterTest, ClosesAFileAtItsSizeAndLosesNothing) {
  SegmentWriter writer(config_, "0a1b");
  ASSERT_TRUE(writer.Open());
  for (int i = 0; i < 25; ++i)
    writer.Append(i, "IMAGE_front", hundred_kilobytes_);
  ASSERT_TRUE(writer.Close());
  const auto files = Files();
  EXPECT_EQ(files.size(), 3U);
  EXPECT_THAT(files.front().filename().string(), HasSubstr("relocd-19700101-000000-0a1b-0000"));
  std::int64_t events = 0;
  for (const auto& file : files)
    events += CountEvents(file);
  EXPECT_EQ(events, 25);
}

TEST_F(SegmentWriterTest, DeletesTheOldestAboveItsQuota) {
  SegmentWriter writer(config_, "0a1b");
  ASSERT_TRUE(writer.Open());
  for (int i = 0; i < 100; ++i) {
    writer.Append(i, "IMAGE_front", hundred_kilobytes_);
    writer.Flush();
  }
  ASSERT_TRUE(writer.Close());
  EXPECT_GT(writer.counters().segments_deleted, 5);
  std::uintmax_t total = 0;
  for (const auto& file : Files())
    total += fs::file_size(file);
  EXPECT_LE(total, 4'200'000U);
  EXPECT_EQ(writer.counters().dropped, 0);
}

TEST_F(SegmentWriterTest, KeepsItsQuotaAndItsOwnFilesWhenTheClockIsInThePast) {
  fs::create_directories(config_.directory);
  const std::string other_run = config_.directory + "/relocd-20260101-000000-ffff-0000.lcmlog";
  ASSERT_TRUE(WriteFile(other_run, std::string(3'500'000, '\0')));
  SegmentWriter writer(config_, "0a1b");
  ASSERT_TRUE(writer.Open());
  for (int i = 0; i < 25; ++i)
    writer.Append(i, "IMAGE_front", hundred_kilobytes_);  // in 1970
  writer.Flush();
  EXPECT_FALSE(fs::exists(other_run));
  EXPECT_EQ(Files().size(), 3U);
}

TEST_F(SegmentWriterTest, DeletesTheOldestWhenOthersFillTheDisk) {
  std::int64_t free_bytes = 1'000'000'000;
  config_.min_free_mb = 500;
  SegmentWriter writer(config_, "0a1b", [&free_bytes](const std::string&) -> Result<std::int64_t> {
    return free_bytes;
  });
  ASSERT_TRUE(writer.Open());
  for (int i = 0; i < 25; ++i)
    writer.Append(i, "IMAGE_front", hundred_kilobytes_);
  EXPECT_EQ(Files().size(), 3U);
  free_bytes = 400'000'000;
  writer.Flush();
  EXPECT_EQ(Files().size(), 1U) << "only the file being written stays";
}

TEST_F(SegmentWriterTest, CountsWhatTheDiskRefusesAndRecovers) {
  SegmentWriter writer(config_, "0a1b");
  ASSERT_TRUE(writer.Open());
  fs::remove_all(config_.directory);  // the disk is gone
  writer.Append(0, "POSE", hundred_kilobytes_);
  EXPECT_EQ(writer.counters().dropped, 1);
  EXPECT_THAT(writer.problem(), HasSubstr("creating log"));
  fs::create_directories(config_.directory);
  writer.Append(1, "POSE", hundred_kilobytes_);
  writer.Flush();
  EXPECT_EQ(writer.problem(), "");
  ASSERT_TRUE(writer.Close());
  ASSERT_EQ(Files().size(), 1U);
  EXPECT_EQ(CountEvents(Files().front()), 1);
}

TEST_F(SegmentWriterTest, LeavesExcludedChannelsOut) {
  config_.exclude_channels = {"IMAGE_*", "TEXT"};
  SegmentWriter writer(config_, "0a1b");
  ASSERT_TRUE(writer.Open());
  for (const char* channel : {"IMAGE_front", "TEXT", "TEXTURE", "POSE"}) {
    writer.Append(0, channel, hundred_kilobytes_);
  }
  ASSERT_TRUE(writer.Close());
  EXPECT_EQ(CountEvents(Files().front()), 2);
}

}  // namespace
}  // namespace relocd
