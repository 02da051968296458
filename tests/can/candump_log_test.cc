#include "can/candump_log.h"

#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using testing::ElementsAre;

TEST(ParseCandumpLineTest, ReadsADataFrame) {
  const auto record = ParseCandumpLine("(46408.584954) can0 0B4#000000001D0B7A5E");
  ASSERT_TRUE(record);
  EXPECT_EQ(record->time_ns, 46408584954000);
  EXPECT_EQ(record->interface, "can0");
  EXPECT_EQ(record->frame.id, (CanId{.value = 0xB4}));
  EXPECT_EQ(ToNanoseconds(record->frame.receive_time), 46408584954000);
  EXPECT_THAT(record->frame.payload(), ElementsAre(0, 0, 0, 0, 0x1D, 0x0B, 0x7A, 0x5E));
}

TEST(ParseCandumpLineTest, KeepsTheMicrosecondsOfWallClockTimes) {
  const auto record = ParseCandumpLine("(1700000000.123457) can0 001#");
  ASSERT_TRUE(record);
  EXPECT_EQ(record->time_ns, 1700000000123457000);
}

TEST(ParseCandumpLineTest, ReadsExtendedRemoteErrorAndFdFrames) {
  const auto extended = ParseCandumpLine("(0.0) can0 00000123#01");
  ASSERT_TRUE(extended);
  EXPECT_EQ(extended->frame.id, (CanId{.value = 0x123, .extended = true}));
  const auto remote = ParseCandumpLine("(0.0) can0 123#R");
  ASSERT_TRUE(remote);
  EXPECT_TRUE(remote->frame.remote);
  const auto error = ParseCandumpLine("(0.0) can0 20000040#0000000000000000");
  ASSERT_TRUE(error);
  EXPECT_TRUE(error->frame.error);
  EXPECT_EQ(error->frame.id.value, 0x40U);
  const auto fd = ParseCandumpLine("(0.0) can0 123##1000102030405060708090A0B T");
  ASSERT_TRUE(fd) << fd.error().message;
  EXPECT_TRUE(fd->frame.fd);
  EXPECT_TRUE(fd->frame.bit_rate_switch);
  EXPECT_EQ(fd->frame.size, 12);
  EXPECT_EQ(fd->frame.data[11], 0x0B);
}

struct LineCase {
  const char* name;
  const char* line;
  const char* error;
};

class MalformedCandumpLineTest : public testing::TestWithParam<LineCase> {};

TEST_P(MalformedCandumpLineTest, SaysWhatIsWrongAndWhatIsAllowed) {
  const auto record = ParseCandumpLine(GetParam().line);
  ASSERT_FALSE(record);
  EXPECT_EQ(record.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(record.error().message, GetParam().error);
}

INSTANTIATE_TEST_SUITE_P(
    Lines,
    MalformedCandumpLineTest,
    testing::ValuesIn(std::vector<LineCase>{
        {"Prose", "no candump", "time 'no', must be (SECONDS.MICROSECONDS)"},
        {"NegativeTime", "(-1.0) can0 1#", "time '(-1.0)', must be (SECONDS.MICROSECONDS)"},
        {"NotANumber", "(nan) can0 001#", "time '(nan)', must be (SECONDS.MICROSECONDS)"},
        {"HugeTime",
         "(99999999999999.0) can0 001#",
         "time '(99999999999999.0)', must be (SECONDS.MICROSECONDS)"},
        {"NoInterface", "(1.0)", "no interface after the time, must be like can0"},
        {"NoFrame", "(1.0) can0", "frame '', must be ID#DATA"},
        {"ShortId",
         "(1.0) can0 12#",
         "identifier '12', must be 3 hexadecimal digits up to 7FF or 8 up to 1FFFFFFF"},
        {"WideId",
         "(1.0) can0 FFF#",
         "identifier 'FFF', must be 3 hexadecimal digits up to 7FF or 8 up to 1FFFFFFF"},
        {"HalfAByte", "(1.0) can0 123#012", "data '012', must be pairs of hexadecimal digits"},
        {"NoHex", "(1.0) can0 123#0G", "data '0G', must be pairs of hexadecimal digits"},
        {"NineBytes",
         "(1.0) can0 123#010203040506070809",
         "data '010203040506070809', must be at most 8 bytes"},
        {"FdSize",
         "(1.0) can0 123##0010203040506070809",
         "9 bytes of CAN FD data, must be 0 to 8, 12, 16, 20, 24, 32, 48 or 64"},
        {"FdFlags", "(1.0) can0 123##", "no digit of CAN FD flags after '##'"},
        {"RemoteLength", "(1.0) can0 123#R9", "remote frame length '9', must be 0 to 8 or nothing"},
        {"More", "(1.0) can0 123#01 02", "'02' after the frame, must be nothing, R or T"},
    }),
    [](const auto& instance) { return instance.param.name; });

CandumpRecord RandomRecord(std::mt19937& engine) {
  const auto below = [&](std::uint64_t end) {
    return std::uniform_int_distribution<std::uint64_t>(0, end - 1)(engine);
  };
  CandumpRecord record;
  record.time_ns = static_cast<std::int64_t>(below(2'000'000'000'000'000)) * 1000;
  record.interface = "can" + std::to_string(below(10));
  CanFrame& frame = record.frame;
  frame.id.extended = below(2) == 1;
  frame.id.value = static_cast<std::uint32_t>(
      below((frame.id.extended ? kCanExtendedMask : kCanStandardMask) + 1ULL));
  frame.fd = below(2) == 1;
  frame.bit_rate_switch = frame.fd && below(2) == 1;
  frame.error_state_indicator = frame.fd && below(2) == 1;
  frame.size = static_cast<std::uint8_t>(frame.fd && below(2) == 1 ? 64 : below(9));
  for (std::uint8_t& byte : frame.payload())
    byte = static_cast<std::uint8_t>(below(256));
  return record;
}

TEST(CandumpLineTest, ReadsWhatItWrites) {
  std::mt19937 engine(1);
  for (int i = 0; i < 1000; ++i) {
    const CandumpRecord record = RandomRecord(engine);
    const std::string line = FormatCandumpLine(record);
    const auto read = ParseCandumpLine(line);
    ASSERT_TRUE(read) << line << ": " << read.error().message;
    EXPECT_EQ(FormatCandumpLine(*read), line);
    EXPECT_EQ(read->time_ns, record.time_ns);
    EXPECT_EQ(read->frame.id, record.frame.id);
    EXPECT_EQ(read->frame.data, record.frame.data);
  }
}

TEST(CandumpLineTest, SurvivesHostileBytes) {
  std::mt19937 engine(2);
  for (int i = 0; i < 20000; ++i) {
    std::string line = FormatCandumpLine(RandomRecord(engine));
    for (std::uint32_t k = engine() % 4 + 1; k > 0; --k) {
      line[engine() % line.size()] = static_cast<char>(engine() % 256);
    }
    line.resize(engine() % (line.size() + 1));
    const auto record = ParseCandumpLine(line);  // must not crash, nor accept what is no frame
    if (record) {
      EXPECT_LE(record->frame.size, record->frame.fd ? 64 : 8);
      EXPECT_LE(record->frame.id.value, kCanExtendedMask);
    }
  }
}

TEST(CandumpLogTest, PassesOverCommentsAndEmptyLinesAndNamesTheLine) {
  CandumpLog log =
      CandumpLog::FromText("# recorded\n\n(1.0) can0 123#01\r\n(1.5) can0 oops\n", "x.log");
  const auto first = log.Next();
  ASSERT_TRUE(first && first->has_value());
  EXPECT_EQ((*first)->frame.id.value, 0x123U);
  EXPECT_EQ(log.Next().error().message, "x.log: line 4: frame 'oops', must be ID#DATA");
}

TEST(CandumpLogTest, EndsWithNothing) {
  CandumpLog log = CandumpLog::FromText("(1.0) can0 123#01", "x.log");
  ASSERT_TRUE(log.Next());
  const auto end = log.Next();
  ASSERT_TRUE(end);
  EXPECT_FALSE(end->has_value());
}

TEST(CandumpLogTest, LeavesOutALastLineThatIsCutOffAndSaysSo) {
  const std::string line = "(1.500000) can0 123#0102";
  for (const std::size_t size : {1U, 5U, 13U, 18U, 21U, 23U}) {
    CandumpLog log = CandumpLog::FromText("(1.0) can0 123#01\n" + line.substr(0, size), "x.log");
    ASSERT_TRUE(log.Next());
    EXPECT_EQ(log.LeftOut(), "");
    const auto end = log.Next();
    ASSERT_TRUE(end) << size;
    EXPECT_FALSE(end->has_value());
    EXPECT_EQ(log.LeftOut(), "x.log: line 2 is cut off and left out");
  }
}

TEST(CandumpLogTest, IsNoLogWithNothingButALineThatIsNone) {
  CandumpLog log = CandumpLog::FromText(
      "\x7f"
      "ELF",
      "x.log");
  EXPECT_EQ(log.Next().error().message,
            "x.log: line 1: time '\x7f"
            "ELF', must be (SECONDS.MICROSECONDS)");
}

TEST(CandumpLogTest, SaysThatAFolderIsNoLog) {
  auto log = CandumpLog::Open("/");
  ASSERT_TRUE(log);
  EXPECT_EQ(log->Next().error().message, "reading /: Is a directory");
}

TEST(CandumpLogTest, GivesTheDataFramesOfOneInterface) {
  CandumpLog log = CandumpLog::FromText(
      "(1.0) can1 123#01\n(1.1) can0 20000080#0000000000000000\n(1.2) can0 123#R\n"
      "(1.3) can0 124#02\n(1.4) can0 oops\n",
      "x.log");
  const auto frame = log.NextDataFrame("can0");
  ASSERT_TRUE(frame && frame->has_value());
  EXPECT_EQ((*frame)->id.value, 0x124U);
  EXPECT_EQ(ToNanoseconds((*frame)->receive_time), 1'300'000'000);
  EXPECT_EQ(log.NextDataFrame("can0").error().message,
            "x.log: line 5: frame 'oops', must be ID#DATA");
  const auto end = log.NextDataFrame("can0");
  ASSERT_TRUE(end);
  EXPECT_FALSE(end->has_value());
}

TEST(CandumpLogTest, RefusesTimesThatDecreaseOnAnInterface) {
  CandumpLog log = CandumpLog::FromText(
      "(2.0) can0 123#01\n(1.9) can1 123#01\n(2.0) can0 123#01\n(1.5) can0 123#01\n", "x.log");
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(log.Next());
  EXPECT_EQ(log.Next().error().message,
            "x.log: line 4: time 1.500000 s is before the 2.000000 s of the frame before on can0, "
            "must not decrease");
}

}  // namespace
}  // namespace relocd
