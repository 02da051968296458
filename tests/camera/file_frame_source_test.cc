#include "camera/file_frame_source.h"

#include <chrono>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.h"
#include "support/test_images.h"

namespace relocd {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr int kFrames = 10;

/// Ten images, 0.1 s apart from 20 s on; image i is 16 + i px wide. Played from `epoch_`.
class FileFrameSourceTest : public testing::Test {
 protected:
  FileFrameSourceTest() {
    std::string frames;
    std::string poses;
    for (int i = 0; i < kFrames; ++i) {
      const auto jpeg = MakeTestJpeg(16 + i, 16);
      const std::string name = fmt::format("images/{}.jpg", i);
      folder_.Write(name, {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
      frames += name + "\n";
      poses += fmt::format("{} 0 0 0 0 0 0 1\n", 20.0 + 0.1 * i);
    }
    folder_.Write("frames.txt", frames);
    folder_.Write("poses_tum.txt", poses);
    folder_.Write("intrinsics.txt", "50 50 8 8 16 16\n");
    config_.dataset = folder_.path();
    config_.playback_start_s = 19.0;  // so that the first image is due one second after the epoch
  }

  [[nodiscard]] std::unique_ptr<FileFrameSource> Open() const {
    auto source = FileFrameSource::Open(config_, epoch_);
    EXPECT_TRUE(source) << source.error().message;
    return std::move(source).value();
  }

  TemporaryFolder folder_;
  FileCameraConfig config_;
  MonotonicTime epoch_ = FromNanoseconds(5'000'000'000'000);
};

TEST_F(FileFrameSourceTest, GivesEachImageWhenItIsDue) {
  const auto source = Open();
  ASSERT_TRUE(source->Start(epoch_ - seconds(2)));
  EXPECT_EQ(source->fd(), -1);
  MonotonicTime now = epoch_ - seconds(2);
  for (int i = 0; i < kFrames; ++i) {
    const MonotonicTime due = epoch_ + seconds(1) + i * milliseconds(100);
    EXPECT_EQ(source->NextWakeUp(), due);
    EXPECT_FALSE(source->Next(now));
    EXPECT_FALSE(source->Next(due - std::chrono::nanoseconds(1)));
    const auto frame = source->Next(due);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->time, due);
    EXPECT_EQ(frame->sequence, i);
    EXPECT_EQ(frame->width, 16 + i);
    EXPECT_EQ(frame->height, 16);
    EXPECT_EQ(frame->flags, 0);
    EXPECT_TRUE(FindWholeJpeg(frame->bytes));
    now = due;
  }
  EXPECT_TRUE(source->ended());
  EXPECT_EQ(source->NextWakeUp(), MonotonicTime::max());
  EXPECT_FALSE(source->Next(now + seconds(100)));
  EXPECT_EQ(source->counters().delivered, kFrames);
  EXPECT_EQ(source->counters().dropped, 0);
}

TEST_F(FileFrameSourceTest, AFrameThatIsALittleLateKeepsItsTime) {
  const auto source = Open();
  ASSERT_TRUE(source->Start(epoch_));
  const MonotonicTime now = epoch_ + seconds(1) + milliseconds(250);
  for (int i = 0; i < 3; ++i) {
    const auto frame = source->Next(now);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->time, epoch_ + seconds(1) + i * milliseconds(100));
  }
  EXPECT_FALSE(source->Next(now));
}

TEST_F(FileFrameSourceTest, ResumesInTheMiddle) {
  const auto source = Open();
  const MonotonicTime now = epoch_ + seconds(1) + milliseconds(720);
  ASSERT_TRUE(source->Start(now));
  const auto frame = source->Next(now);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->sequence, 3);  // at most half a second late
  EXPECT_EQ(frame->flags, kFrameAfterGap);
  EXPECT_EQ(source->counters().dropped, 3);
  EXPECT_EQ(source->Next(now)->flags, 0);
}

TEST_F(FileFrameSourceTest, ARecordingThatIsOverEndsAtOnce) {
  const auto source = Open();
  ASSERT_TRUE(source->Start(epoch_ + seconds(60)));
  EXPECT_TRUE(source->ended());
  EXPECT_FALSE(source->Next(epoch_ + seconds(60)));
}

TEST_F(FileFrameSourceTest, TwiceTheRateHalvesTheTimes) {
  config_.rate = 2.0;
  const auto source = Open();
  ASSERT_TRUE(source->Start(epoch_));
  EXPECT_EQ(source->NextWakeUp(), epoch_ + milliseconds(500));
  ASSERT_TRUE(source->Next(epoch_ + milliseconds(500)));
  EXPECT_EQ(source->NextWakeUp(), epoch_ + milliseconds(550));
}

TEST_F(FileFrameSourceTest, ARateOfZeroIsAsFastAsPossibleWithTheRecordedTimes) {
  config_.rate = 0.0;
  const auto source = Open();
  ASSERT_TRUE(source->Start(epoch_ + seconds(60)));  // nothing is ever late
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_LE(source->NextWakeUp(), epoch_);
    const auto frame = source->Next(epoch_);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->time, epoch_ + seconds(1) + i * milliseconds(100));
  }
  EXPECT_TRUE(source->ended());
}

TEST_F(FileFrameSourceTest, PlaysAPart) {
  config_.frames = "4:6";
  const auto source = Open();
  ASSERT_TRUE(source->Start(epoch_));
  EXPECT_EQ(source->NextWakeUp(), epoch_ + milliseconds(1400));
  EXPECT_EQ(source->Next(epoch_ + milliseconds(1600))->sequence, 4);
  EXPECT_EQ(source->Next(epoch_ + milliseconds(1600))->sequence, 5);
  EXPECT_TRUE(source->ended());
}

TEST_F(FileFrameSourceTest, PassesOverFilesThatAreMissingOrNoJpeg) {
  std::filesystem::remove(folder_.path() + "/images/0.jpg");
  folder_.Write("images/1.jpg", "this is text");
  const auto source = Open();
  ASSERT_TRUE(source->Start(epoch_));
  const auto frame = source->Next(epoch_ + milliseconds(1200));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->sequence, 2);
  EXPECT_EQ(frame->flags, kFrameAfterGap);
  EXPECT_EQ(source->counters().damaged, 2);
  EXPECT_THAT(source->TakeNotices(),
              ElementsAre(HasSubstr(folder_.path() + "/images/0.jpg"),
                          HasSubstr(folder_.path() + "/images/1.jpg: decoding JPEG: 12 bytes")));
  EXPECT_THAT(source->TakeNotices(), testing::IsEmpty());
}

TEST_F(FileFrameSourceTest, RefusesARangeOutsideTheRecording) {
  config_.frames = "10:12";
  const auto source = FileFrameSource::Open(config_, epoch_);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(source.error().message,
            folder_.path() +
                "/frames.txt: the range is '10:12', must be 'A:B' with 0 <= A < B and "
                "A < 10");
}

TEST_F(FileFrameSourceTest, RefusesARecordingWithAnotherClock) {
  config_.playback_start_s = 0.0;
  std::string poses;
  for (int i = 0; i < kFrames; ++i)
    poses += fmt::format("{} 0 0 0 0 0 0 1\n", 1'500'000'000 + i);
  folder_.Write("poses_tum.txt", poses);
  const auto started = Open()->Start(epoch_);
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(started.error().message,
            folder_.path() +
                "/images/0.jpg: is due in 1500000000 s, file.playback_start_s must be "
                "near its recorded time of 1500000000.000 s");
}

TEST_F(FileFrameSourceTest, ABadDataSetIsAnErrorAtOnce) {
  folder_.Write("poses_tum.txt", "1 2 3\n");
  const auto source = FileFrameSource::Open(config_, epoch_);
  ASSERT_FALSE(source);
  EXPECT_THAT(source.error().message, HasSubstr("poses_tum.txt: line 1: is '1 2 3', must be"));
}

}  // namespace
}  // namespace relocd
