#include "report_log.h"

#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "messaging/channels.h"
#include "messaging/image_metadata.h"
#include "recording/log_event.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A log in memory.
class MadeLog {
 public:
  /// @param age_us  between the measurement and its arrival at the recorder.
  template <typename Message>
  void Add(const std::string& channel, Message message, std::int64_t age_us = 0) {
    constexpr std::int64_t kTime_us = 1'000'000;
    message.utime = kTime_us;
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    log_format::AppendEvent(number_++, kTime_us + age_us, channel, bytes, text_);
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::int64_t number_ = 0;
  std::string text_;
};

image_t ImageAt(std::int64_t mono_ns, const std::string& jpeg) {
  image_t image{};
  image.data.assign(jpeg.begin(), jpeg.end());
  image.size = static_cast<std::int32_t>(image.data.size());
  SetImageMetadata({.mono_ns = mono_ns}, image);
  return image;
}

status_t Status(const std::string& daemon, const std::vector<status_value_t>& values) {
  status_t status{};
  status.daemon = daemon;
  status.values = values;
  status.n = static_cast<std::int32_t>(values.size());
  return status;
}

status_value_t Value(const std::string& name, double value) {
  status_value_t made;
  made.name = name;
  made.value = value;
  return made;
}

TEST(ReportLogTest, GivesLatenciesAsRecordedAndAsLastReported) {
  MadeLog log;
  for (int i = 0; i <= 100; ++i)
    log.Add("POSE", pose_t{}, 10 * i);
  log.Add("STATUS_inferenced",
          Status("inferenced",
                 {Value("image_to_pose_p50_ms", 1.0), Value("image_to_pose_p99_ms", 2.0)}));
  log.Add("STATUS_inferenced",
          Status("inferenced",
                 {Value("image_to_pose_p50_ms", 20.0), Value("image_to_pose_p99_ms", 30.0)}));
  const TemporaryFolder folder;
  const auto facts = ReadLogFacts(folder.Write("drive.lcmlog", log.text()), 0);
  ASSERT_TRUE(facts) << facts.error().message;
  ASSERT_EQ(facts->latencies.size(), 2U);
  EXPECT_EQ(facts->latencies[0].key, "can_to_pose");
  EXPECT_NEAR(facts->latencies[0].p50_ms, 0.5, 1e-9);
  EXPECT_NEAR(facts->latencies[0].p99_ms, 0.99, 1e-9);
  EXPECT_EQ(facts->latencies[1].key, "image_to_camera_pose_reported");
  EXPECT_EQ(facts->latencies[1].p50_ms, 20.0);
  EXPECT_EQ(facts->latencies[1].p99_ms, 30.0);
  EXPECT_EQ(facts->messages, 103);
}

TEST(ReportLogTest, GivesTheImagesOfTheTimesAskedFor) {
  MadeLog log;
  log.Add("IMAGE_front", ImageAt(1'000'000'100, "first"));
  log.Add("IMAGE_front", ImageAt(1'000'000'200, "second"));
  const TemporaryFolder folder;
  const std::string path = folder.Write("drive.lcmlog", log.text());
  constexpr std::int64_t kOrigin_ns = 1'000'000'000;
  const auto facts = ReadLogFacts(path, kOrigin_ns);
  ASSERT_TRUE(facts);
  EXPECT_THAT(facts->image_times_ns, ElementsAre(100, 200));
  const auto images = ReadLogImages(path, kOrigin_ns, {200, 150, 100});
  ASSERT_TRUE(images);
  EXPECT_THAT(*images, ElementsAre("second", "", "first"));
}

TEST(ReportLogTest, AFileThatIsNoLogIsRefused) {
  const TemporaryFolder folder;
  const auto facts = ReadLogFacts(folder.Write("notes.txt", "hello"), 0);
  ASSERT_FALSE(facts);
  EXPECT_EQ(facts.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(facts.error().message, HasSubstr("notes.txt: has no message in 5 bytes, must be of"));
}

}  // namespace
}  // namespace relocd
