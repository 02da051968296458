#include <chrono>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>

#include "camera/v4l2_frame_source.h"

namespace relocd {
namespace {

TEST(V4l2KernelTest, ADeviceThatIsNotThereIsSaid) {
  KernelV4l2System kernel;
  CameraConfig config;
  config.device = "/dev/no_such_camera";
  V4l2FrameSource source(config, kernel);
  ASSERT_TRUE(source.Start(MonotonicClock::now()));
  EXPECT_EQ(source.problem(), "/dev/no_such_camera: opening: No such file or directory");
}

TEST(V4l2KernelTest, AFileThatIsNoDeviceIsSaid) {
  KernelV4l2System kernel;
  CameraConfig config;
  config.device = "/dev/null";
  V4l2FrameSource source(config, kernel);
  ASSERT_TRUE(source.Start(MonotonicClock::now()));
  EXPECT_EQ(source.problem(),
            "/dev/null: asking for its capabilities: Inappropriate ioctl for device");
}

TEST(V4l2KernelTest, ARealCameraGivesFrames) {
  CameraConfig config;
  if (!std::filesystem::exists(config.device)) {
    GTEST_SKIP() << "this machine has no " << config.device << " (modprobe vivid makes one)";
  }
  KernelV4l2System kernel;
  V4l2FrameSource source(config, kernel);
  ASSERT_TRUE(source.Start(MonotonicClock::now()));
  ASSERT_GE(source.fd(), 0) << source.problem();
  const MonotonicTime deadline = MonotonicClock::now() + std::chrono::seconds(5);
  std::optional<Frame> frame;
  while (!frame && MonotonicClock::now() < deadline) {
    frame = source.Next(MonotonicClock::now());
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ASSERT_TRUE(frame) << source.problem();
  EXPECT_LT(std::chrono::abs(MonotonicClock::now() - frame->time), std::chrono::seconds(1));
}

}  // namespace
}  // namespace relocd
