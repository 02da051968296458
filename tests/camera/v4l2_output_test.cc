#include "camera/v4l2_output.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "camera/frame_source.h"
#include "support/fake_v4l2_output.h"
#include "support/test_images.h"

namespace relocd {
namespace {

using testing::HasSubstr;

constexpr V4l2OutputFormat kFormat{
    .fourcc = kFourccMjpeg, .width = 64, .height = 48, .frame_rate_hz = 8.0};

std::string ErrorOf(FakeV4l2Output& device) {
  const auto output = V4l2Output::Open(device, "/dev/video7", kFormat);
  return output ? std::string() : output.error().message;
}

TEST(V4l2OutputTest, HandsFramesOverInTheirOrder) {
  FakeV4l2Output device;
  {
    const auto output = V4l2Output::Open(device, "/dev/video7", kFormat);
    ASSERT_TRUE(output) << output.error().message;
    EXPECT_TRUE(device.is_streaming);
    EXPECT_EQ(device.format.width, 64U);
    EXPECT_EQ(device.format.pixelformat, kFourccMjpeg);
    for (int i = 1; i <= 10; ++i)  // more than it has buffers
      ASSERT_TRUE((*output)->Write(MakeTestJpeg(64, 48, 9 * i)));
  }
  ASSERT_EQ(device.frames.size(), 10U);
  for (int i = 1; i <= 10; ++i)
    EXPECT_EQ(device.frames[static_cast<std::size_t>(i - 1)], MakeTestJpeg(64, 48, 9 * i));
  EXPECT_FALSE(device.is_streaming);
  EXPECT_EQ(device.open_fds, 0);
  EXPECT_EQ(device.mapped, 0);
}

TEST(V4l2OutputTest, RefusesWhatIsNoOutputDevice) {
  FakeV4l2Output file;
  file.is_v4l2 = false;
  EXPECT_THAT(ErrorOf(file), HasSubstr("/dev/video7: is no V4L2 device: "));
  FakeV4l2Output camera;
  camera.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  EXPECT_THAT(ErrorOf(camera), HasSubstr("output and streaming, as a loopback device has"));
  FakeV4l2Output missing;
  missing.open_error = ENOENT;
  EXPECT_EQ(ErrorOf(missing), "/dev/video7: opening: No such file or directory");
  FakeV4l2Output busy;
  busy.is_fed_already = true;
  EXPECT_THAT(ErrorOf(busy),
              HasSubstr("setting the format (is it fed already?): Invalid argument"));
  FakeV4l2Output other;
  other.only_format = kFourccYuyv;
  EXPECT_EQ(ErrorOf(other), "/dev/video7: takes YUYV of 64 x 48 px, must take MJPG of 64 x 48");
  EXPECT_EQ(other.open_fds, 0);
}

TEST(V4l2OutputTest, NamesAFrameThatDoesNotFit) {
  FakeV4l2Output device;
  const auto output = V4l2Output::Open(device, "/dev/video7", kFormat);
  ASSERT_TRUE(output);
  const std::vector<std::uint8_t> large(FakeV4l2Output::kBufferSize + 1);
  for (int i = 0; i < 10; ++i) {  // and takes no buffer away
    EXPECT_EQ((*output)->Write(large).error().message,
              "/dev/video7: a frame has 65537 bytes, must have at most 65536");
  }
  EXPECT_TRUE((*output)->Write(MakeTestJpeg(64, 48)));
}

TEST(V4l2OutputTest, NamesADeviceThatGoes) {
  FakeV4l2Output device;
  const auto output = V4l2Output::Open(device, "/dev/video7", kFormat);
  ASSERT_TRUE(output);
  device.queue_error = ENODEV;
  EXPECT_EQ((*output)->Write(MakeTestJpeg(64, 48)).error().message,
            "/dev/video7: handing a frame over: No such device");
}

}  // namespace
}  // namespace relocd
