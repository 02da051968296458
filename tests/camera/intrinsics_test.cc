#include "camera/intrinsics.h"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

constexpr CameraIntrinsics kValid{
    .fx = 500.0, .fy = 501.0, .cx = 320.0, .cy = 240.0, .width = 640, .height = 480};

TEST(CameraIntrinsicsTest, AcceptsAnOrdinaryCamera) {
  EXPECT_TRUE(kValid.Validate());
}

struct BadIntrinsics {
  std::string name;
  void (*spoil)(CameraIntrinsics&);
  std::string message;
};

class CameraIntrinsicsErrorTest : public testing::TestWithParam<BadIntrinsics> {};

TEST_P(CameraIntrinsicsErrorTest, NamesFieldValueAndWhatIsAllowed) {
  CameraIntrinsics intrinsics = kValid;
  GetParam().spoil(intrinsics);
  const auto valid = intrinsics.Validate();
  ASSERT_FALSE(valid);
  EXPECT_EQ(valid.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(valid.error().message, GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    All,
    CameraIntrinsicsErrorTest,
    testing::Values(
        BadIntrinsics{"Fx", [](CameraIntrinsics& c) { c.fx = -1.0; }, "fx is -1, must be above 0"},
        BadIntrinsics{"FyNan",
                      [](CameraIntrinsics& c) { c.fy = std::numeric_limits<double>::quiet_NaN(); },
                      "fy is nan, must be above 0"},
        BadIntrinsics{"CxOutside",
                      [](CameraIntrinsics& c) { c.cx = 640.0; },
                      "cx is 640, must be in [0, width 640)"},
        BadIntrinsics{"CyOutside",
                      [](CameraIntrinsics& c) { c.cy = -0.5; },
                      "cy is -0.5, must be in [0, height 480)"},
        BadIntrinsics{
            "Width", [](CameraIntrinsics& c) { c.width = 0; }, "width is 0, must be in [1, 8192]"},
        BadIntrinsics{"Height",
                      [](CameraIntrinsics& c) { c.height = 9000; },
                      "height is 9000, must be in [1, 8192]"},
        BadIntrinsics{
            "Distortion",
            [](CameraIntrinsics& c) { c.distortion[2] = std::numeric_limits<double>::infinity(); },
            "distortion is inf, must be finite"}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace relocd
