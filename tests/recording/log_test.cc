#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lcm/lcm.h>

#include "core/file.h"
#include "recording/log_reader.h"
#include "recording/log_writer.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

class LogTest : public testing::Test {
 protected:
  void WriteEvents(int count) {
    auto writer = LogWriter::Create(path_);
    ASSERT_TRUE(writer) << writer.error().message;
    for (int i = 0; i < count; ++i) {
      const std::vector<std::uint8_t> data(static_cast<std::size_t>(i % 300),
                                           static_cast<std::uint8_t>(i));
      ASSERT_TRUE(writer->Append(1000 + i, "CHANNEL_" + std::to_string(i % 3), data));
    }
    ASSERT_TRUE(writer->Sync());
  }

  std::vector<LogEvent> ReadAll(LogReader::Counters* counters = nullptr) const {
    auto reader = LogReader::Open(path_);
    EXPECT_TRUE(reader);
    std::vector<LogEvent> events;
    while (auto event = reader->Next())
      events.push_back(*std::move(event));
    if (counters != nullptr) *counters = reader->counters();
    return events;
  }

  TemporaryFolder temporary_;
  std::string path_ = temporary_.path() + "/test.lcmlog";
};

TEST_F(LogTest, ReadsBackWhatWasWritten) {
  WriteEvents(1000);
  LogReader::Counters counters;
  const auto events = ReadAll(&counters);
  ASSERT_EQ(events.size(), 1000U);
  for (std::size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(events[i].number, static_cast<std::int64_t>(i));
    EXPECT_EQ(events[i].timestamp_us, 1000 + static_cast<std::int64_t>(i));
    EXPECT_EQ(events[i].channel, "CHANNEL_" + std::to_string(i % 3));
    EXPECT_EQ(events[i].data.size(), i % 300);
  }
  EXPECT_EQ(counters.damaged_places, 0);
}

TEST_F(LogTest, IsWhatLcmsOwnReaderReads) {
  WriteEvents(50);
  lcm_eventlog_t* log = ::lcm_eventlog_create(path_.c_str(), "r");
  ASSERT_NE(log, nullptr);
  int count = 0;
  while (lcm_eventlog_event_t* event = ::lcm_eventlog_read_next_event(log)) {
    EXPECT_EQ(event->eventnum, count);
    EXPECT_EQ(event->timestamp, 1000 + count);
    EXPECT_EQ(std::string(event->channel, static_cast<std::size_t>(event->channellen)),
              "CHANNEL_" + std::to_string(count % 3));
    ++count;
    ::lcm_eventlog_free_event(event);
  }
  ::lcm_eventlog_destroy(log);
  EXPECT_EQ(count, 50);
}

TEST_F(LogTest, GoesOnBehindDamage) {
  WriteEvents(300);
  std::string bytes = ReadFile(path_).value();
  const std::size_t middle = bytes.size() / 2;
  for (std::size_t i = 0; i < 1000; ++i)
    bytes[middle + i] = static_cast<char>(0xA5);
  ASSERT_TRUE(WriteFileAtomically(path_, bytes));
  LogReader::Counters counters;
  const auto events = ReadAll(&counters);
  EXPECT_GT(events.size(), 285U);
  EXPECT_EQ(events.back().number, 299);
  EXPECT_EQ(counters.damaged_places, 1);
  EXPECT_GE(counters.skipped_bytes, 500);
}

TEST_F(LogTest, ReadsATruncatedLogUpToTheCut) {
  WriteEvents(100);
  std::string bytes = ReadFile(path_).value();
  bytes.resize(bytes.size() - 5);
  ASSERT_TRUE(WriteFileAtomically(path_, bytes));
  LogReader::Counters counters;
  EXPECT_EQ(ReadAll(&counters).size(), 99U);
  EXPECT_EQ(counters.damaged_places, 1);
}

TEST_F(LogTest, SurvivesRandomDamage) {
  WriteEvents(60);
  const std::string bytes = ReadFile(path_).value();
  std::mt19937 random(3);
  for (int trial = 0; trial < 200; ++trial) {
    std::string damaged = bytes;
    for (int i = 0; i < 5; ++i) {
      damaged[std::uniform_int_distribution<std::size_t>(0, damaged.size() - 1)(random)] =
          static_cast<char>(random());
    }
    std::ofstream(path_, std::ios::binary) << damaged;
    EXPECT_GE(ReadAll().size(), 50U) << "each damaged byte costs two events at most";
  }
}

TEST_F(LogTest, NamesALogThatIsNotThere) {
  const auto reader = LogReader::Open("/nonexistent/x.lcmlog");
  ASSERT_FALSE(reader);
  EXPECT_THAT(reader.error().message, HasSubstr("/nonexistent/x.lcmlog"));
}

TEST_F(LogTest, RefusesAFileThatIsNoLog) {
  ASSERT_TRUE(WriteFile(path_, "time_ns,x_m\n0,1\n"));
  const auto reader = LogReader::Open(path_);
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(reader.error().message,
            "log " + path_ + ": has no message in 16 bytes, must be of lcm-logger or recorderd");
}

TEST_F(LogTest, ReadsNothingOfAnEmptyLogAndOfOneCutInItsFirstEvent) {
  WriteEvents(1);
  const std::string bytes = ReadFile(path_).value();
  for (const std::size_t size : {std::size_t{0}, std::size_t{2}, std::size_t{30}}) {
    ASSERT_TRUE(WriteFile(path_, bytes.substr(0, size)));
    LogReader::Counters counters;
    EXPECT_EQ(ReadAll(&counters).size(), 0U);
    EXPECT_EQ(counters.events, 0);
    EXPECT_EQ(counters.skipped_bytes, static_cast<std::int64_t>(size));
  }
}

TEST_F(LogTest, ReadsALogWhoseBeginIsDamaged) {
  WriteEvents(3);
  const std::string bytes = ReadFile(path_).value();
  ASSERT_TRUE(WriteFile(path_, bytes.substr(5)));
  LogReader::Counters counters;
  EXPECT_EQ(ReadAll(&counters).size(), 2U);
  EXPECT_EQ(counters.events, 2);
  EXPECT_EQ(counters.damaged_places, 1);
}

TEST_F(LogTest, AFolderIsNoEmptyLog) {
  const auto reader = LogReader::Open("/");
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error().message, "reading log /: Is a directory");
}

}  // namespace
}  // namespace relocd
