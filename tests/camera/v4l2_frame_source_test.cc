#include "camera/v4l2_frame_source.h"

#include <chrono>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/fake_v4l2.h"
#include "support/test_images.h"

namespace relocd {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kDevice = "/dev/video7";

/// A camera of 64 x 48 px, and a clock that a test moves.
class V4l2FrameSourceTest : public testing::Test {
 protected:
  static CameraConfig Config(const std::string& pixel_format = "MJPG") {
    CameraConfig config;
    config.device = kDevice;
    config.width = 64;
    config.height = 48;
    config.pixel_format = pixel_format;
    return config;
  }

  /// A frame that was taken 5 ms ago.
  FakeFrame Taken(std::uint32_t sequence) const {
    return {.bytes = jpeg_, .sequence = sequence, .stamp = now_ - milliseconds(5)};
  }

  FakeV4l2 camera_;
  MonotonicTime now_ = FromNanoseconds(1'000'000'000'000);
  std::vector<std::uint8_t> jpeg_ = MakeTestJpeg(64, 48);
};

TEST_F(V4l2FrameSourceTest, GivesTheCamerasJpegsUnchanged) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  EXPECT_GE(source.fd(), 0);
  EXPECT_FALSE(source.Next(now_));
  camera_.frames = {Taken(0)};
  const auto frame = source.Next(now_);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->bytes, jpeg_);
  EXPECT_EQ(frame->fourcc, kFourccMjpeg);
  EXPECT_EQ(frame->width, 64);
  EXPECT_EQ(frame->height, 48);
  EXPECT_EQ(frame->time, now_ - milliseconds(5));
  EXPECT_EQ(frame->flags, 0);
  EXPECT_EQ(frame->exposure_us, -1);
  EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(source.counters().delivered, 1);
  EXPECT_EQ(source.problem(), "");
  EXPECT_THAT(source.TakeNotices(),
              ElementsAre(kDevice + ": controls: jpeg_quality is the camera's own",
                          kDevice + ": MJPG 64 x 48 px at 30 Hz"));
}

TEST_F(V4l2FrameSourceTest, GivesEachBufferBackAfterItWasFetched) {
  {
    V4l2FrameSource source(Config(), camera_);
    ASSERT_TRUE(source.Start(now_));
    camera_.calls.clear();
    for (std::uint32_t i = 0; i < 6; ++i) {
      camera_.frames = {Taken(i)};
      ASSERT_TRUE(source.Next(now_));
      EXPECT_EQ(camera_.queued(), 4U);
    }
    EXPECT_THAT(camera_.calls,
                ElementsAre("dequeue 0",
                            "queue 0",
                            "dequeue 1",
                            "queue 1",
                            "dequeue 2",
                            "queue 2",
                            "dequeue 3",
                            "queue 3",
                            "dequeue 0",
                            "queue 0",
                            "dequeue 1",
                            "queue 1"));
  }
  EXPECT_EQ(camera_.mapped, 0);
  EXPECT_EQ(camera_.open_fds, 0);
}

TEST_F(V4l2FrameSourceTest, DropsFramesThatAreDamagedAndCountsThem) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  FakeFrame flagged = Taken(0);
  flagged.flags |= V4L2_BUF_FLAG_ERROR;
  FakeFrame cut = Taken(1);
  cut.bytes.resize(cut.bytes.size() / 2);
  FakeFrame headless = Taken(2);
  headless.bytes.erase(headless.bytes.begin());
  FakeFrame hollow = Taken(3);
  hollow.bytes = {0xFF, 0xD8, 0xFF, 0xD9};
  FakeFrame empty = Taken(4);
  empty.bytes.clear();
  camera_.frames = {flagged, cut, headless, hollow, empty, Taken(5)};
  const auto frame = source.Next(now_);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->sequence, 5);
  EXPECT_EQ(frame->flags, kFrameAfterGap);
  EXPECT_EQ(source.counters().damaged, 5);
  EXPECT_EQ(source.counters().delivered, 1);
  EXPECT_EQ(camera_.queued(), 4U);
}

TEST_F(V4l2FrameSourceTest, CountsGapsInTheDriversSequence) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  // The counter wraps between the third and the fourth.
  camera_.frames = {Taken(0xFFFFFFF0), Taken(0xFFFFFFF1), Taken(0xFFFFFFFF), Taken(2)};
  std::vector<std::int32_t> flags;
  while (const auto frame = source.Next(now_))
    flags.push_back(frame->flags);
  EXPECT_THAT(flags, ElementsAre(0, 0, kFrameAfterGap, kFrameAfterGap));
  EXPECT_EQ(source.counters().dropped, 13 + 2);
}

TEST_F(V4l2FrameSourceTest, ADriverThatDoesNotCountHasNoGaps) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  camera_.frames = {Taken(0), Taken(0), Taken(0)};
  while (const auto frame = source.Next(now_))
    EXPECT_EQ(frame->flags, 0);
  EXPECT_EQ(source.counters().delivered, 3);
  EXPECT_EQ(source.counters().dropped, 0);
}

struct StampCase {
  std::string name;
  Duration age;
  std::uint32_t flags;
  bool is_used;
};

class V4l2StampTest : public V4l2FrameSourceTest, public testing::WithParamInterface<StampCase> {};

TEST_P(V4l2StampTest, OnlyAPlausibleMonotonicTimeIsUsed) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  FakeFrame taken = Taken(0);
  taken.stamp = now_ - GetParam().age;
  taken.flags = GetParam().flags;
  camera_.frames = {taken};
  const auto frame = source.Next(now_);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->time, GetParam().is_used ? taken.stamp : now_);
  EXPECT_EQ(frame->flags, GetParam().is_used ? 0 : kFrameTimeOfReceipt);
}

INSTANTIATE_TEST_SUITE_P(
    All,
    V4l2StampTest,
    testing::Values(
        StampCase{"Monotonic", milliseconds(33), V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, true},
        StampCase{"OfAnotherClock", milliseconds(33), V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN, false},
        StampCase{"Copied", milliseconds(33), V4L2_BUF_FLAG_TIMESTAMP_COPY, false},
        StampCase{"JustAhead", -milliseconds(2), V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, true},
        StampCase{"InTheFuture", -milliseconds(200), V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, false},
        StampCase{"Old", milliseconds(1500), V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, false}),
    [](const auto& instance) { return instance.param.name; });

TEST_F(V4l2FrameSourceTest, TheTimeIsTheMiddleOfAKnownExposure) {
  camera_.controls = {
      {.id = V4L2_CID_EXPOSURE_AUTO, .name = "Auto Exposure", .value = V4L2_EXPOSURE_MANUAL},
      {.id = V4L2_CID_EXPOSURE_ABSOLUTE, .name = "Exposure Time, Absolute", .value = 80}};  // 8 ms
  CameraConfig config = Config();
  config.time_offset_ms = -1.5;
  V4l2FrameSource source(config, camera_);
  ASSERT_TRUE(source.Start(now_));
  FakeFrame at_start = Taken(0);
  at_start.flags |= V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  camera_.frames = {at_start, Taken(1)};
  const auto first = source.Next(now_);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->exposure_us, 8000);
  EXPECT_EQ(first->time, at_start.stamp + milliseconds(4) - microseconds(1500));
  const auto second = source.Next(now_);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->time, at_start.stamp - milliseconds(4) - microseconds(1500));
}

TEST_F(V4l2FrameSourceTest, EncodesYuyvToJpeg) {
  camera_.extra_bytes_per_line = 16;
  V4l2FrameSource source(Config("YUYV"), camera_);
  ASSERT_TRUE(source.Start(now_));
  const GrayImage image = MakeTestImage(64, 48);
  FakeFrame taken = Taken(0);
  taken.bytes.assign(48 * (2 * 64 + 16), 128);
  for (std::size_t v = 0; v < 48; ++v) {
    for (std::size_t u = 0; u < 64; ++u)
      taken.bytes[v * (2 * 64 + 16) + 2 * u] = image.pixels[v * 64 + u];
  }
  FakeFrame cut = taken;
  cut.bytes.resize(1000);
  camera_.frames = {cut, taken};
  const auto frame = source.Next(now_);
  ASSERT_TRUE(frame);
  EXPECT_EQ(source.counters().damaged, 1);
  const auto decoded = DecodeJpegToGray(frame->bytes);
  ASSERT_TRUE(decoded) << decoded.error().message;
  ASSERT_EQ(decoded->pixels.size(), image.pixels.size());
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    ASSERT_NEAR(decoded->pixels[i], image.pixels[i], 20);
}

TEST_F(V4l2FrameSourceTest, EncodesGreyToJpeg) {
  camera_.extra_bytes_per_line = 8;
  V4l2FrameSource source(Config("GREY"), camera_);
  ASSERT_TRUE(source.Start(now_));
  FakeFrame taken = Taken(0);
  taken.bytes.assign(48 * 72, 200);
  FakeFrame cut = taken;
  cut.bytes.resize(48 * 72 - 9);  // the last line's padding may be missing, its last pixel not
  camera_.frames = {cut, taken};
  const auto frame = source.Next(now_);
  ASSERT_TRUE(frame);
  EXPECT_EQ(source.counters().damaged, 1);
  const auto decoded = DecodeJpegToGray(frame->bytes);
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->width, 64);
  EXPECT_NEAR(decoded->pixels[1000], 200, 2);
}

TEST_F(V4l2FrameSourceTest, TakesAnotherFormatWhenTheCameraHasNotTheWantedOne) {
  camera_.formats = {V4L2_PIX_FMT_GREY};
  V4l2FrameSource source(Config("MJPG"), camera_);
  ASSERT_TRUE(source.Start(now_));
  FakeFrame taken = Taken(0);
  taken.bytes.assign(48 * 64, 90);
  camera_.frames = {taken};
  ASSERT_TRUE(source.Next(now_));
  EXPECT_THAT(source.TakeNotices(), ElementsAre(kDevice + ": GREY 64 x 48 px at 30 Hz"));
}

TEST_F(V4l2FrameSourceTest, TakesTheFormatAndSizeThatTheDriverChose) {
  camera_.formats = {V4L2_PIX_FMT_YUYV};
  camera_.refuses_other_formats = false;
  camera_.size = {32, 24};
  camera_.has_frame_rate = false;
  V4l2FrameSource source(Config("MJPG"), camera_);
  ASSERT_TRUE(source.Start(now_));
  FakeFrame taken = Taken(0);
  taken.bytes.assign(32 * 24 * 2, 90);
  camera_.frames = {taken};
  const auto frame = source.Next(now_);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->width, 32);
  EXPECT_EQ(frame->height, 24);
}

TEST_F(V4l2FrameSourceTest, SaysWhatACameraWithoutAUsableFormatGives) {
  camera_.formats = {V4L2_PIX_FMT_H264};
  camera_.refuses_other_formats = false;
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  EXPECT_EQ(source.problem(), kDevice + ": gives H264 at 64 x 48 px, must give MJPG, YUYV or GREY");
  EXPECT_EQ(camera_.open_fds, 0);
}

TEST_F(V4l2FrameSourceTest, RefusesADeviceThatIsNoCamera) {
  camera_.capabilities = V4L2_CAP_VIDEO_OUTPUT;
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  EXPECT_EQ(source.problem(),
            kDevice + ": has the capabilities 0x2, must have 0x4000001: capture and streaming");
}

TEST_F(V4l2FrameSourceTest, RefusesASingleBuffer) {
  camera_.granted_buffers = 1;
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  EXPECT_EQ(source.problem(), kDevice + ": asking for buffers: has 1, must have at least 2");
}

TEST_F(V4l2FrameSourceTest, WaitsForACameraThatIsNotThereYet) {
  camera_.Unplug();
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  EXPECT_EQ(source.fd(), -1);
  EXPECT_EQ(source.problem(), kDevice + ": opening: No such file or directory");
  EXPECT_EQ(source.NextWakeUp(), now_ + milliseconds(500));
  camera_.plugged_in = true;
  EXPECT_FALSE(source.Next(now_ + milliseconds(499)));
  EXPECT_EQ(source.fd(), -1);
  now_ += milliseconds(500);
  EXPECT_FALSE(source.Next(now_));
  EXPECT_GE(source.fd(), 0);
  camera_.frames = {Taken(0)};
  ASSERT_TRUE(source.Next(now_));
  EXPECT_EQ(source.problem(), "");
  EXPECT_EQ(source.counters().reopened, 1);
  EXPECT_THAT(source.TakeNotices(),
              ElementsAre(kDevice + ": controls: jpeg_quality is the camera's own",
                          kDevice + ": MJPG 64 x 48 px at 30 Hz, back after 0.5 s (" + kDevice +
                              ": opening: No such file or directory)"));
}

TEST_F(V4l2FrameSourceTest, SurvivesBeingUnplugged) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  camera_.frames = {Taken(0)};
  ASSERT_TRUE(source.Next(now_));
  static_cast<void>(source.TakeNotices());
  camera_.Unplug();
  now_ += milliseconds(10);
  const MonotonicTime lost = now_;
  EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(source.problem(), kDevice + ": fetching a frame: No such device");
  EXPECT_EQ(camera_.mapped, 0);
  EXPECT_EQ(camera_.open_fds, 0);
  for (; now_ < lost + std::chrono::seconds(10); now_ += milliseconds(100))
    EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(source.problem(), kDevice + ": opening: No such file or directory");
  EXPECT_THAT(source.TakeNotices(), testing::IsEmpty()) << "the status says it, once";
  camera_.plugged_in = true;
  const MonotonicTime back = now_;
  std::optional<Frame> frame;
  for (; !frame && now_ < back + std::chrono::seconds(2); now_ += milliseconds(10)) {
    if (source.fd() >= 0) camera_.frames = {Taken(0)};
    frame = source.Next(now_);
  }
  ASSERT_TRUE(frame);
  EXPECT_LT(now_ - back, std::chrono::seconds(1));
  EXPECT_EQ(frame->flags, kFrameAfterGap);
  EXPECT_EQ(source.counters().reopened, 1);
  EXPECT_EQ(source.problem(), "");
  EXPECT_THAT(source.TakeNotices().back(),
              HasSubstr("s (" + kDevice + ": fetching a frame: No such device; " + kDevice +
                        ": opening: No such file or directory)"));
  EXPECT_EQ(camera_.open_fds, 1);
}

TEST_F(V4l2FrameSourceTest, RestartsAFrozenStreamAndThenOpensTheDeviceAgain) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  EXPECT_EQ(source.NextWakeUp(), now_ + milliseconds(1000));
  camera_.calls.clear();
  now_ = source.NextWakeUp();
  EXPECT_FALSE(source.Next(now_));
  EXPECT_THAT(camera_.calls, ElementsAre("off", "queue 0", "queue 1", "queue 2", "queue 3", "on"));
  EXPECT_EQ(source.counters().stalls, 1);
  EXPECT_EQ(source.fd() >= 0, true);

  now_ = source.NextWakeUp();
  EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(source.fd(), -1);
  EXPECT_EQ(source.problem(), kDevice + ": gave no frame for 1000 ms");

  now_ = source.NextWakeUp();
  EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(camera_.opened, 2);
  camera_.frames = {Taken(0)};
  ASSERT_TRUE(source.Next(now_));
  EXPECT_EQ(source.problem(), "");
}

TEST_F(V4l2FrameSourceTest, OnlyDamagedFramesAreAFrozenStream) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  FakeFrame flagged = Taken(0);
  flagged.flags |= V4L2_BUF_FLAG_ERROR;
  const MonotonicTime due = source.NextWakeUp();
  for (; now_ < due; now_ += milliseconds(33)) {
    camera_.frames = {flagged};
    EXPECT_FALSE(source.Next(now_));
  }
  EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(source.counters().stalls, 1);
}

TEST_F(V4l2FrameSourceTest, AStreamThatCannotBeRestartedIsOpenedAgain) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  camera_.restarts = false;
  now_ = source.NextWakeUp();
  EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(source.fd(), -1);
  EXPECT_EQ(source.problem(), kDevice + ": stopping the stream: Input/output error");
}

TEST_F(V4l2FrameSourceTest, AnInputErrorRestartsTheStream) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  camera_.frames = {Taken(0), {.bytes = {}, .error = EIO}};
  ASSERT_TRUE(source.Next(now_));
  EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(source.counters().stalls, 1);
  EXPECT_EQ(camera_.Count("on"), 2);
  camera_.frames = {Taken(0)};
  const auto frame = source.Next(now_);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->flags, kFrameAfterGap);
  EXPECT_EQ(source.counters().dropped, 0);
}

TEST_F(V4l2FrameSourceTest, AgreesOnTheFormatAnewAfterEachLoss) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  camera_.Unplug();
  EXPECT_FALSE(source.Next(now_));
  camera_.plugged_in = true;
  camera_.formats = {V4L2_PIX_FMT_GREY};  // another camera, on the same port
  now_ = source.NextWakeUp();
  EXPECT_FALSE(source.Next(now_));
  FakeFrame taken = Taken(0);
  taken.bytes.assign(48 * 64, 90);
  camera_.frames = {taken};
  EXPECT_TRUE(source.Next(now_));
  EXPECT_THAT(source.TakeNotices().back(), HasSubstr("GREY 64 x 48 px"));
}

TEST_F(V4l2FrameSourceTest, ABusyDeviceIsSaidInWords) {
  camera_.Unplug();
  camera_.open_error = EBUSY;
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  EXPECT_EQ(source.problem(), kDevice + ": opening: Device or resource busy");
}

TEST_F(V4l2FrameSourceTest, AStormOfFramesEndsACall) {
  V4l2FrameSource source(Config(), camera_);
  ASSERT_TRUE(source.Start(now_));
  FakeFrame flagged = Taken(0);
  flagged.flags |= V4L2_BUF_FLAG_ERROR;
  camera_.frames.assign(10'000, flagged);
  EXPECT_FALSE(source.Next(now_));
  EXPECT_FALSE(camera_.frames.empty());
}

}  // namespace
}  // namespace relocd
