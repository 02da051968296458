#include "camerad/camera_node.h"

#include <chrono>
#include <deque>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "camera/v4l2_frame_source.h"
#include "messaging/image_metadata.h"
#include "messaging/in_process_bus.h"
#include "support/fake_v4l2.h"
#include "support/test_images.h"

namespace relocd {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;

/// Gives the frames that a test puts into it.
class FakeSource final : public FrameSource {
 public:
  Result<void> Start(MonotonicTime /*now*/) override { return {}; }
  [[nodiscard]] int fd() const override { return -1; }
  [[nodiscard]] MonotonicTime NextWakeUp() const override { return MonotonicTime::max(); }
  std::optional<Frame> Next(MonotonicTime /*now*/) override {
    if (frames.empty()) return std::nullopt;
    Frame frame = std::move(frames.front());
    frames.pop_front();
    return frame;
  }
  void SetProblem(const std::string& problem) { problem_ = problem; }
  void AddNotice(const std::string& notice) { notices_.push_back(notice); }
  FrameCounters& mutable_counters() { return counters_; }

  std::deque<Frame> frames;
};

/// A bus whose network is down.
class DownBus final : public MessageBus {
 public:
  Result<void> PublishBytes(const std::string& /*channel*/,
                            std::span<const std::uint8_t> /*bytes*/) override {
    return Error{ErrorKind::kUnavailable, "publishing: network is unreachable"};
  }
  int HandlePending() override { return 0; }
  [[nodiscard]] int fd() const override { return -1; }

 protected:
  void OnSubscribe(Subscription& /*subscription*/) override {}
};

double ValueOf(const NodeStatus& status, const std::string& name) {
  for (const StatusValue& value : status.values) {
    if (value.name == name) return value.value;
  }
  ADD_FAILURE() << "no value " << name;
  return 0.0;
}

class CameraNodeTest : public testing::Test {
 protected:
  static constexpr std::int64_t kRunId = 42;

  CameraNodeTest() {
    bus_.Subscribe<image_t>(ImageChannel("front"), Delivery::kEvery, [this](const image_t& image) {
      images_.push_back(image);
    });
  }

  static CameraConfig Config() {
    CameraConfig config;
    config.width = 64;
    config.height = 48;
    return config;
  }

  [[nodiscard]] Frame MakeFrame(Duration age) const {
    return {.bytes = MakeTestJpeg(64, 48),
            .width = 64,
            .height = 48,
            .time = now_.monotonic - age,
            .sequence = 7,
            .flags = kFrameAfterGap,
            .exposure_us = 8000};
  }

  void HandleFrames(int count) {
    for (int i = 0; i < count; ++i)
      node_.HandleSource(now_);
  }

  InProcessBus bus_;
  FakeSource source_;
  CameraNode node_{"front", Config(), source_, bus_, kRunId};
  ClockReading now_{.monotonic = FromNanoseconds(500'000'000'000),
                    .realtime_us = 1'700'000'000'000'000};
  std::vector<image_t> images_;
};

TEST_F(CameraNodeTest, PublishesAFrameWithTheTimeItWasTaken) {
  const Frame frame = MakeFrame(milliseconds(20));
  source_.frames = {frame};
  node_.HandleSource(now_);
  bus_.HandlePending();
  ASSERT_EQ(images_.size(), 1U);
  const image_t& image = images_.front();
  EXPECT_EQ(image.utime, now_.realtime_us - 20'000);
  EXPECT_EQ(image.width, 64);
  EXPECT_EQ(image.height, 48);
  EXPECT_EQ(image.row_stride, 0);
  EXPECT_EQ(image.pixelformat, 0x47504A4D);
  EXPECT_EQ(image.data, frame.bytes);
  EXPECT_EQ(FindImageMetadata(image),
            (ImageMetadata{.mono_ns = ToNanoseconds(frame.time),
                           .seq = 0,
                           .run_id = kRunId,
                           .flags = kFrameAfterGap,
                           .exposure_us = 8000}));
}

TEST_F(CameraNodeTest, PublishesOneFrameAtATimeSoThatTheLoopGoesOn) {
  source_.frames = {MakeFrame(milliseconds(70)), MakeFrame(milliseconds(35))};
  node_.HandleSource(now_);
  bus_.HandlePending();
  EXPECT_EQ(images_.size(), 1U);
}

TEST_F(CameraNodeTest, CountsItsMessagesWithoutGaps) {
  for (int i = 0; i < 3; ++i) {
    source_.frames = {MakeFrame(milliseconds(70)), MakeFrame(milliseconds(35))};
    HandleFrames(2);
    now_.monotonic += milliseconds(70);
  }
  bus_.HandlePending();
  ASSERT_EQ(images_.size(), 6U);
  for (std::size_t i = 0; i < images_.size(); ++i)
    EXPECT_EQ(FindImageMetadata(images_[i])->seq, static_cast<std::int64_t>(i));
  EXPECT_EQ(bus_.counters().at("IMAGE_front").stream.lost, 0);
}

TEST_F(CameraNodeTest, StatusHasRateAgeAndTheSourcesCounters) {
  source_.mutable_counters() = {
      .delivered = 60, .dropped = 3, .damaged = 2, .stalls = 1, .reopened = 4};
  for (int i = 0; i < 90; ++i) {
    source_.frames = {MakeFrame(milliseconds(12))};
    node_.HandleSource(now_);
    now_.monotonic += milliseconds(50);
  }
  const NodeStatus status = node_.Status(now_);
  EXPECT_EQ(status.level, status_t::OK);
  EXPECT_EQ(status.message, "");
  EXPECT_EQ(ValueOf(status, "frames"), 90.0);
  EXPECT_NEAR(ValueOf(status, "frame_rate_hz"), 20.0, 0.5);
  EXPECT_NEAR(ValueOf(status, "image_age_ms"), 12.0, 1e-9);
  EXPECT_EQ(ValueOf(status, "frames_dropped"), 3.0);
  EXPECT_EQ(ValueOf(status, "frames_damaged"), 2.0);
  EXPECT_EQ(ValueOf(status, "stream_restarts"), 1.0);
  EXPECT_EQ(ValueOf(status, "device_reopened"), 4.0);
  EXPECT_EQ(ValueOf(node_.Status({.monotonic = now_.monotonic + seconds(3)}), "frame_rate_hz"),
            0.0);
}

TEST_F(CameraNodeTest, ASourceWithoutFramesIsAnErrorUntilTheyComeAgain) {
  source_.SetProblem("/dev/video0: opening: No such file or directory");
  const NodeStatus lost = node_.Status(now_);
  EXPECT_EQ(lost.level, status_t::ERROR);
  EXPECT_EQ(lost.message, "no frames: /dev/video0: opening: No such file or directory");
  source_.SetProblem("");
  EXPECT_EQ(node_.Status(now_).level, status_t::OK);
}

TEST_F(CameraNodeTest, AnotherSizeThanAskedForIsAWarning) {
  Frame frame = MakeFrame(milliseconds(1));
  frame.width = 32;
  source_.frames = {frame};
  node_.HandleSource(now_);
  const NodeStatus status = node_.Status(now_);
  EXPECT_EQ(status.level, status_t::WARNING);
  EXPECT_EQ(status.message, "images are 32 x 48 px, the config asks for 64 x 48");
}

TEST_F(CameraNodeTest, ImagesAboveOneDatagramAreCountedAndSaidOnce) {
  Frame frame = MakeFrame(milliseconds(1));
  frame.bytes.resize(CameraNode::kOneDatagramBytes);
  source_.frames = {frame};
  node_.HandleSource(now_);
  EXPECT_EQ(node_.Status(now_).level, status_t::OK);
  frame.bytes.push_back(0);
  source_.frames = {frame, frame, frame};
  HandleFrames(3);
  const NodeStatus status = node_.Status(now_);
  EXPECT_EQ(status.level, status_t::WARNING);
  EXPECT_EQ(status.message, "images have 65401 bytes, above 65400 are easily lost");
  EXPECT_EQ(ValueOf(status, "frames_oversize"), 3.0);
  EXPECT_THAT(node_.TakeNotices(),
              ElementsAre(HasSubstr("an image has 65401 bytes, above 65400 it is easily lost")));
  bus_.HandlePending();
  EXPECT_EQ(images_.size(), 4U);  // published all the same
}

TEST_F(CameraNodeTest, PassesTheSourcesNoticesOnOnce) {
  source_.AddNotice("back after 3.2 s");
  EXPECT_THAT(node_.TakeNotices(), ElementsAre("back after 3.2 s"));
  EXPECT_THAT(node_.TakeNotices(), testing::IsEmpty());
}

TEST_F(CameraNodeTest, ANetworkThatIsDownIsAnErrorAndCounted) {
  DownBus down;
  CameraNode node("front", Config(), source_, down, kRunId);
  source_.frames = {MakeFrame(milliseconds(1)), MakeFrame(milliseconds(1))};
  node.HandleSource(now_);
  node.HandleSource(now_);
  const NodeStatus status = node.Status(now_);
  EXPECT_EQ(status.level, status_t::ERROR);
  EXPECT_EQ(status.message, "publishing: network is unreachable");
  EXPECT_EQ(ValueOf(status, "publish_failures"), 2.0);
}

TEST(CameraNodeChainTest, AV4l2CameraComesOutAsMessages) {
  CameraConfig config;
  config.width = 64;
  config.height = 48;
  FakeV4l2 camera;
  V4l2FrameSource source(config, camera);
  InProcessBus bus;
  int received = 0;
  bus.Subscribe<image_t>(ImageChannel("rear"), Delivery::kEvery, [&](const image_t& image) {
    EXPECT_TRUE(DecodeJpegToGray(image.data));
    ++received;
  });
  CameraNode node("rear", config, source, bus, 1);
  ClockReading now{.monotonic = FromNanoseconds(9'000'000'000)};
  ASSERT_TRUE(source.Start(now.monotonic));
  for (std::uint32_t i = 0; i < 10; ++i) {
    now.monotonic += milliseconds(33);
    camera.frames.push_back(
        {.bytes = MakeTestJpeg(64, 48), .sequence = i, .stamp = now.monotonic - milliseconds(4)});
    node.HandleSource(now);
  }
  bus.HandlePending();
  EXPECT_EQ(received, 10);
  EXPECT_EQ(node.Status(now).level, status_t::OK);
}

}  // namespace
}  // namespace relocd
