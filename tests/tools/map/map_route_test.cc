#include "map_route.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using testing::HasSubstr;

/// A camera that looks along its way: `begin_m` to `end_m` of x, `left_m` beside it. Backwards if
/// the end is before the begin.
SelectedFrames Drive(double begin_m, double end_m, double step_m, double left_m) {
  SelectedFrames drive;
  drive.name = "drive";
  drive.dataset.directory = "drive";
  drive.dataset.intrinsics = {
      .fx = 100.0, .fy = 100.0, .cx = 50.0, .cy = 40.0, .width = 100, .height = 80};
  const double direction = end_m > begin_m ? 1.0 : -1.0;
  const double yaw = direction > 0.0 ? 0.0 : std::numbers::pi;
  const Pose3 X_BC(RotationFromRollPitchYaw(-std::numbers::pi / 2.0, 0.0, -std::numbers::pi / 2.0),
                   {0.0, 0.0, 1.5});
  for (int i = 0; i * step_m <= std::abs(end_m - begin_m); ++i) {
    const Pose3 X_WB(RotationFromRollPitchYaw(0.0, 0.0, yaw),
                     {begin_m + direction * i * step_m, left_m, 0.0});
    drive.dataset.frames.push_back(
        {.index = i, .image_path = "", .time_ns = i * 100'000'000LL, .X_WC = X_WB * X_BC});
  }
  return drive;
}

TEST(MapRouteTest, OtherDrivesAreWhereTheFirstOneStood) {
  const auto placed =
      PlaceOnRoute({Drive(0.0, 100.0, 1.0, 0.0), Drive(20.0, 80.0, 3.0, 1.0)}, 8).value();
  ASSERT_EQ(placed.size(), 101U + 21U);
  for (const RouteFrame& frame : placed)
    EXPECT_NEAR(frame.along_m, frame.frame.X_WC.translation().x(), 0.51);
  EXPECT_EQ(placed[100].drive, 0U);
  EXPECT_EQ(placed[101].drive, 1U);
}

TEST(MapRouteTest, WhereARoadIsDrivenBothWaysTheDirectionTells) {
  SelectedFrames there_and_back = Drive(0.0, 50.0, 1.0, 0.0);
  for (DatasetFrame frame : Drive(50.0, 0.0, 1.0, 3.0).dataset.frames) {
    frame.index += 51;
    there_and_back.dataset.frames.push_back(frame);
  }
  const auto placed = PlaceOnRoute({there_and_back, Drive(40.0, 10.0, 1.0, 1.0)}, 8).value();
  for (const RouteFrame& frame : placed) {
    if (frame.drive == 1) {
      EXPECT_GT(frame.along_m, 50.0);
    }
  }
}

TEST(MapRouteTest, ThePartHeldOutIsTheSameOfEachDrive) {
  const auto placed =
      PlaceOnRoute({Drive(0.0, 79.0, 1.0, 0.0), Drive(0.0, 79.0, 1.0, 1.0)}, 8).value();
  for (const std::size_t drive : {0U, 1U}) {
    EXPECT_EQ(std::count_if(placed.begin(),
                            placed.end(),
                            [drive](const RouteFrame& frame) {
                              return frame.drive == drive && frame.is_held_out;
                            }),
              10);
  }
}

TEST(MapRouteTest, RegionsCoverTheRouteAndOverlap) {
  const auto placed =
      PlaceOnRoute({Drive(0.0, 400.0, 1.0, 0.0), Drive(0.0, 400.0, 2.0, 1.0)}, 8).value();
  const auto regions = DivideRoute(placed, 150.0, 20.0);
  ASSERT_EQ(regions.size(), 3U);
  std::size_t frames = 0;
  for (std::size_t i = 0; i < regions.size(); ++i) {
    frames += regions[i].training.size() + regions[i].held_out.size();
    const auto [first, last] = std::minmax_element(
        regions[i].training.begin(), regions[i].training.end(), [](const auto& a, const auto& b) {
          return a.along_m < b.along_m;
        });
    EXPECT_NEAR(first->along_m, std::max(0.0, 400.0 / 3.0 * static_cast<double>(i) - 10.0), 1.1);
    EXPECT_LE(last->along_m - first->along_m, 400.0 / 3.0 + 20.0);
  }
  // Two overlaps of 20 m, each with 20 or 21 frames of one drive and half as many of the other.
  EXPECT_NEAR(static_cast<double>(frames), static_cast<double>(placed.size()) + 62.0, 3.0);
}

TEST(MapRouteTest, AShortRouteIsOneRegion) {
  const auto placed = PlaceOnRoute({Drive(0.0, 100.0, 1.0, 0.0)}, 8).value();
  EXPECT_EQ(DivideRoute(placed, 150.0, 20.0).size(), 1U);
}

TEST(MapRouteTest, DrivesMustShareRouteCameraAndWorld) {
  auto refused = PlaceOnRoute({Drive(0.0, 100.0, 1.0, 0.0), Drive(90.0, 150.0, 1.0, 0.0)}, 8);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("frame 26 is 16.0 m from the route of drive"));

  SelectedFrames other = Drive(0.0, 50.0, 1.0, 0.0);
  other.dataset.intrinsics.fx = 101.0;
  refused = PlaceOnRoute({Drive(0.0, 50.0, 1.0, 0.0), other}, 8);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("intrinsics.txt is another"));
}

}  // namespace
}  // namespace relocd
