#include "camera/v4l2_controls.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "camera/frame_source.h"
#include "camera/v4l2_description.h"
#include "camera/v4l2_frame_rates.h"
#include "camera/v4l2_frame_source.h"
#include "support/fake_v4l2.h"
#include "support/test_images.h"

namespace relocd {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::IsEmpty;

const std::string kDevice = "/dev/video7";

/// As a USB camera lists them.
std::vector<FakeControl> ControlsOfAUsbCamera() {
  return {{.id = V4L2_CID_BRIGHTNESS, .name = "Brightness", .minimum = -64, .maximum = 64},
          {.id = V4L2_CID_AUTOGAIN, .name = "Gain, Automatic", .maximum = 1, .value = 1},
          {.id = V4L2_CID_GAIN, .name = "Gain", .maximum = 100, .step = 5, .value = 10},
          {.id = V4L2_CID_POWER_LINE_FREQUENCY,
           .name = "Power Line Frequency",
           .maximum = 2,
           .value = 2,
           .menu = {0, 1, 2}},
          {.id = V4L2_CID_EXPOSURE_AUTO,
           .name = "Auto Exposure",
           .maximum = 3,
           .value = V4L2_EXPOSURE_APERTURE_PRIORITY,
           .menu = {V4L2_EXPOSURE_MANUAL, V4L2_EXPOSURE_APERTURE_PRIORITY}},
          {.id = V4L2_CID_EXPOSURE_ABSOLUTE,
           .name = "Exposure Time, Absolute",
           .minimum = 1,
           .maximum = 5000,
           .value = 157}};
}

class V4l2ControlsTest : public testing::Test {
 protected:
  V4l2ControlsReport Apply(std::uint32_t fourcc = kFourccYuyv) {
    const int fd = camera_.Open(kDevice.c_str(), O_NONBLOCK);
    auto report = ApplyControls(camera_, fd, config_, fourcc);
    camera_.Close(fd);
    return report;
  }

  FakeV4l2 camera_;
  CameraConfig config_;
};

TEST_F(V4l2ControlsTest, TheDefaultLeavesThemAsTheyAre) {
  camera_.controls = ControlsOfAUsbCamera();
  const auto report = Apply();
  EXPECT_THAT(report.given, IsEmpty());
  EXPECT_THAT(report.otherwise, IsEmpty());
  EXPECT_EQ(camera_.Count("control"), 0);
  EXPECT_EQ(report.exposure_us, -1);
}

TEST_F(V4l2ControlsTest, SetsWhatIsAskedAndReadsItBack) {
  camera_.controls = ControlsOfAUsbCamera();
  config_.controls.exposure = "manual";
  config_.controls.exposure_time_ms = 8.0;
  config_.controls.gain = 20;
  config_.controls.power_line_frequency = "50";
  config_.controls.others = {{"brightness", -10}};
  const auto report = Apply();
  EXPECT_THAT(report.given,
              ElementsAre("exposure manual",
                          "exposure_time_ms 8",
                          "autogain 0",
                          "gain 20",
                          "power_line_frequency 50",
                          "brightness -10"));
  EXPECT_THAT(report.otherwise, IsEmpty());
  EXPECT_EQ(report.exposure_us, 8000);
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_EXPOSURE_ABSOLUTE), 80);
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_AUTOGAIN), 0);
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_GAIN), 20);
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_POWER_LINE_FREQUENCY), 1);
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_BRIGHTNESS), -10);
}

TEST_F(V4l2ControlsTest, AutomaticExposureIsTheKindThatTheCameraOffers) {
  camera_.controls = ControlsOfAUsbCamera();
  camera_.controls.at(4).value = V4L2_EXPOSURE_MANUAL;
  config_.controls.exposure = "auto";
  EXPECT_THAT(Apply().given, ElementsAre("exposure auto"));
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_APERTURE_PRIORITY);
}

TEST_F(V4l2ControlsTest, AValueOutOfRangeBecomesTheNearestAndIsSaid) {
  camera_.controls = ControlsOfAUsbCamera();
  config_.controls.exposure = "manual";
  config_.controls.exposure_time_ms = 900.0;
  config_.controls.gain = 300;
  config_.controls.others = {{"brightness", -1000}};
  const auto report = Apply();
  EXPECT_THAT(report.otherwise,
              ElementsAre("exposure_time_ms is 500, asked for 900, allowed [0.1, 500]",
                          "gain is 100, asked for 300, allowed [0, 100] by 5",
                          "brightness is -64, asked for -1000, allowed [-64, 64]"));
  EXPECT_EQ(report.exposure_us, 500'000);
}

TEST_F(V4l2ControlsTest, AValueBetweenTwoStepsBecomesTheNearest) {
  camera_.controls = ControlsOfAUsbCamera();
  camera_.controls.at(2).maximum = 98;  // no multiple of the step
  config_.controls.gain = 98;
  EXPECT_THAT(Apply().otherwise, ElementsAre("gain is 95, asked for 98, allowed [0, 98] by 5"));
  config_.controls.gain = 22;
  EXPECT_THAT(Apply().otherwise, ElementsAre("gain is 20, asked for 22, allowed [0, 98] by 5"));
}

TEST_F(V4l2ControlsTest, WhatACameraLacksIsSaidByName) {
  config_.controls.exposure = "manual";
  config_.controls.gain = 3;
  config_.controls.power_line_frequency = "60";
  config_.controls.others = {{"focus_absolute", 1}};
  const auto report = Apply(kFourccMjpeg);
  EXPECT_THAT(report.otherwise,
              ElementsAre("it has no exposure",
                          "it has no exposure time",
                          "it has no gain",
                          "it has no power_line_frequency",
                          "it has no control 'focus_absolute'"));
  EXPECT_THAT(report.given, ElementsAre("jpeg_quality is the camera's own"));
}

TEST_F(V4l2ControlsTest, AChoiceThatAMenuLacksIsSaidWithThoseThatItHas) {
  camera_.controls = ControlsOfAUsbCamera();
  config_.controls.power_line_frequency = "auto";
  EXPECT_THAT(Apply().otherwise,
              ElementsAre("power_line_frequency cannot be auto, allowed off, 50, 60"));
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_POWER_LINE_FREQUENCY), 2);
}

TEST_F(V4l2ControlsTest, WhatTheDriverRefusesIsSaid) {
  camera_.controls = ControlsOfAUsbCamera();
  camera_.controls.at(2).set_error = EBUSY;
  config_.controls.gain = 20;
  EXPECT_THAT(Apply().otherwise, ElementsAre("setting gain to 20: Device or resource busy"));
}

TEST_F(V4l2ControlsTest, TheQualityIsOfACameraThatMakesJpegs) {
  camera_.controls = {{.id = V4L2_CID_JPEG_COMPRESSION_QUALITY,
                       .name = "Compression Quality",
                       .minimum = 1,
                       .maximum = 100}};
  EXPECT_THAT(Apply(kFourccYuyv).given, IsEmpty());
  EXPECT_THAT(Apply(kFourccMjpeg).given, ElementsAre("jpeg_quality 80"));
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_JPEG_COMPRESSION_QUALITY), 80);
}

TEST_F(V4l2ControlsTest, ListsWhatACameraHas) {
  camera_.controls = {ControlsOfAUsbCamera().at(5), ControlsOfAUsbCamera().at(2)};
  const int fd = camera_.Open(kDevice.c_str(), O_NONBLOCK);
  EXPECT_THAT(ListControls(camera_, fd),
              ElementsAre("gain [0, 100] by 5", "exposure_time_absolute [1, 5000]"));
}

TEST(ControlKeyTest, IsAsV4l2CtlWritesIt) {
  EXPECT_EQ(ControlKey("White Balance, Automatic"), "white_balance_automatic");
  EXPECT_EQ(ControlKey(" Exposure (Absolute) "), "exposure_absolute");
  EXPECT_EQ(ControlKey(""), "");
}

class V4l2FrameRatesTest : public testing::Test {
 protected:
  std::string Text() {
    const int fd = camera_.Open(kDevice.c_str(), O_NONBLOCK);
    return ListFrameRates(camera_, fd, kFourccMjpeg, 640, 480).Text();
  }
  FakeV4l2 camera_;
};

TEST_F(V4l2FrameRatesTest, ListsRatesAndRanges) {
  EXPECT_EQ(Text(), "");
  camera_.frame_periods = {{1, 30}, {1, 25}, {2, 15}};
  EXPECT_EQ(Text(), "30, 25, 7.5 Hz");
  camera_.lists_a_range = true;
  EXPECT_EQ(Text(), "7.5 to 30 Hz");
}

TEST_F(V4l2ControlsTest, ACameraIsDescribedInOneLine) {
  camera_.formats = {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_NV12};
  auto description = DescribeCamera(camera_, config_);
  ASSERT_TRUE(description);
  EXPECT_EQ(*description, "MJPG; NV12; no controls");
  camera_.frame_periods = {{1, 30}, {1, 15}};
  camera_.controls = {{.id = V4L2_CID_GAIN, .name = "Gain"}};
  description = DescribeCamera(camera_, config_);
  ASSERT_TRUE(description);
  EXPECT_EQ(*description,
            "MJPG 640 x 480 px at 30, 15 Hz; NV12 640 x 480 px at 30, 15 Hz; "
            "controls: gain [0, 255]");
  EXPECT_EQ(camera_.open_fds, 0);
  camera_.Unplug();
  description = DescribeCamera(camera_, config_);
  ASSERT_FALSE(description);
  EXPECT_EQ(description.error().message, "/dev/video0: opening: No such file or directory");
}

/// Through the source, as camerad has it.
class V4l2ControlsOfASourceTest : public testing::Test {
 protected:
  V4l2ControlsOfASourceTest() {
    config_.device = kDevice;
    config_.width = 64;
    config_.height = 48;
    config_.controls.gain = 300;
    camera_.controls = ControlsOfAUsbCamera();
    camera_.formats = {V4L2_PIX_FMT_GREY};
  }

  void GiveAFrame(V4l2FrameSource& source) {
    camera_.frames = {{.bytes = std::vector<std::uint8_t>(64 * 48, 90), .stamp = now_}};
    EXPECT_TRUE(source.Next(now_));
  }

  FakeV4l2 camera_;
  CameraConfig config_;
  MonotonicTime now_ = FromNanoseconds(1'000'000'000'000);
};

TEST_F(V4l2ControlsOfASourceTest, AreSetAgainWhenTheCameraIsPluggedInAgain) {
  V4l2FrameSource source(config_, camera_);
  ASSERT_TRUE(source.Start(now_));
  EXPECT_EQ(source.remark(), kDevice + ": gain is 100, asked for 300, allowed [0, 100] by 5");
  EXPECT_THAT(
      source.TakeNotices(),
      ElementsAre(kDevice + ": controls: gain is 100, asked for 300, allowed [0, 100] by 5; "
                            "autogain 0"));
  camera_.Unplug();
  EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(source.remark(), "");
  camera_.plugged_in = true;
  camera_.controls = ControlsOfAUsbCamera();  // it forgot them
  static_cast<void>(source.TakeNotices());
  now_ = source.NextWakeUp();
  EXPECT_FALSE(source.Next(now_));
  EXPECT_EQ(camera_.ValueOf(V4L2_CID_GAIN), 100);
  EXPECT_THAT(source.TakeNotices(), IsEmpty());  // said once
}

TEST_F(V4l2ControlsOfASourceTest, AnotherFrameRateIsSaidWithThoseThatThereAre) {
  config_.controls.gain = -1;
  camera_.frame_periods = {{1, 25}, {1, 10}};
  V4l2FrameSource source(config_, camera_);
  ASSERT_TRUE(source.Start(now_));
  GiveAFrame(source);
  EXPECT_THAT(
      source.TakeNotices(),
      ElementsAre(kDevice + ": GREY 64 x 48 px at 25 Hz (asked for 30, allowed 25, 10 Hz)"));
}

}  // namespace
}  // namespace relocd
