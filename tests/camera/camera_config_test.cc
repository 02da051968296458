#include "camera/camera_config.h"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"

namespace relocd {
namespace {

TEST(CameraConfigTest, TheDefaultIsValid) {
  EXPECT_TRUE(CameraConfig().Validate());
}

TEST(CameraConfigTest, TheDefaultCameraLooksForward) {
  CameraConfig config;
  config.X_BC_translation_m = {1.0, 2.0, 3.0};
  const Pose3 X_BC = config.X_BC();
  // A point 10 m before the camera, 1 m to its right and 2 m below its axis.
  EXPECT_THAT(X_BC * Eigen::Vector3d(1.0, 2.0, 10.0),
              IsNear(Eigen::Vector3d(11.0, 1.0, 1.0), 1e-12));
}

TEST(CameraConfigTest, AYawTurnsTheCameraToTheLeft) {
  CameraConfig config;
  config.X_BC_roll_pitch_yaw_rad[2] += std::numbers::pi / 2.0;
  EXPECT_THAT(config.X_BC() * Eigen::Vector3d(0.0, 0.0, 10.0),
              IsNear(Eigen::Vector3d(0.0, 10.0, 0.0), 1e-12));
}

TEST(CameraConfigTest, APositivePitchLooksDown) {
  CameraConfig config;
  config.X_BC_roll_pitch_yaw_rad[0] -= 0.1;  // about the camera's x axis, to the right
  EXPECT_LT((config.X_BC() * Eigen::Vector3d(0.0, 0.0, 10.0)).z(), -0.9);
}

struct BadConfig {
  std::string name;
  void (*spoil)(CameraConfig&);
  std::string message;
};

class CameraConfigErrorTest : public testing::TestWithParam<BadConfig> {};

TEST_P(CameraConfigErrorTest, NamesFieldValueAndWhatIsAllowed) {
  CameraConfig config;
  GetParam().spoil(config);
  const auto valid = config.Validate();
  ASSERT_FALSE(valid);
  EXPECT_EQ(valid.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(valid.error().message, GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    All,
    CameraConfigErrorTest,
    testing::Values(
        BadConfig{"Driver",
                  [](CameraConfig& c) { c.driver = "usb"; },
                  "driver is 'usb', must be one of v4l2, file"},
        BadConfig{"Device",
                  [](CameraConfig& c) { c.device.clear(); },
                  "device is '', must name a node as /dev/video0"},
        BadConfig{
            "Width", [](CameraConfig& c) { c.width = 0; }, "width is 0, must be in [16, 8192]"},
        BadConfig{"Height",
                  [](CameraConfig& c) { c.height = 10'000; },
                  "height is 10000, must be in [16, 8192]"},
        BadConfig{"FrameRate",
                  [](CameraConfig& c) { c.frame_rate_hz = 0.0; },
                  "frame_rate_hz is 0, must be in [0.1, 240]"},
        BadConfig{
            "FrameRateNan",
            [](CameraConfig& c) { c.frame_rate_hz = std::numeric_limits<double>::quiet_NaN(); },
            "frame_rate_hz is nan, must be in [0.1, 240]"},
        BadConfig{"PixelFormat",
                  [](CameraConfig& c) { c.pixel_format = "RGB3"; },
                  "pixel_format is 'RGB3', must be one of MJPG, YUYV, GREY"},
        BadConfig{"Quality",
                  [](CameraConfig& c) { c.jpeg_quality = 101; },
                  "jpeg_quality is 101, must be in [1, 100]"},
        BadConfig{"MaxBytes",
                  [](CameraConfig& c) { c.max_jpeg_bytes = 10; },
                  "max_jpeg_bytes is 10, must be in [1000, 10000000]"},
        BadConfig{"Timeout",
                  [](CameraConfig& c) { c.no_frame_timeout_ms = 50; },
                  "no_frame_timeout_ms is 50, must be in [100, 60000]"},
        BadConfig{"TimeoutOfThreeFrames",
                  [](CameraConfig& c) { c.frame_rate_hz = 1.0; },
                  "no_frame_timeout_ms is 1000, must be at least 3000: 3 frames at 1 Hz"},
        BadConfig{"TimeOffset",
                  [](CameraConfig& c) { c.time_offset_ms = 2000.0; },
                  "time_offset_ms is 2000, must be in [-1000, 1000]"},
        BadConfig{"Exposure",
                  [](CameraConfig& c) { c.controls.exposure = "bright"; },
                  "controls.exposure is 'bright', must be one of auto, manual, unchanged"},
        BadConfig{"ExposureTime",
                  [](CameraConfig& c) { c.controls.exposure_time_ms = 0.0; },
                  "controls.exposure_time_ms is 0, must be in [0.1, 10000]"},
        BadConfig{"Gain",
                  [](CameraConfig& c) { c.controls.gain = -2; },
                  "controls.gain is -2, must be in [-1, 2147483647]"},
        BadConfig{"PowerLine",
                  [](CameraConfig& c) { c.controls.power_line_frequency = "55"; },
                  "controls.power_line_frequency is '55', must be one of off, 50, 60, auto, "
                  "unchanged"},
        BadConfig{"Translation",
                  [](CameraConfig& c) { c.X_BC_translation_m[1] = 1e6; },
                  "X_BC_translation_m is 1000000, must be in [-100, 100]"},
        BadConfig{"Rotation",
                  [](CameraConfig& c) { c.X_BC_roll_pitch_yaw_rad[0] = -90.0; },
                  "X_BC_roll_pitch_yaw_rad is -90, must be in [-6.283185307179586, "
                  "6.283185307179586]"},
        BadConfig{"NoDataset",
                  [](CameraConfig& c) { c.driver = "file"; },
                  "file.dataset is '', must name a folder when the driver is file"},
        BadConfig{"Frames",
                  [](CameraConfig& c) {
                    c.driver = "file";
                    c.file.dataset = "x";
                    c.file.frames = "7";
                  },
                  "file.frames: the range is '7', must be 'A:B' with 0 <= A < B and A < "
                  "2147483647"},
        BadConfig{"Rate",
                  [](CameraConfig& c) {
                    c.driver = "file";
                    c.file.dataset = "x";
                    c.file.rate = -1.0;
                  },
                  "file.rate is -1, must be in [0, 1000]"}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace relocd
