#include "simulation/torcs_lane.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "simulation/torcs_test_track.h"

namespace relocd {
namespace {

TEST(MakeTorcsLane, KeepsItsDistanceFromTheMiddleOfACircle) {
  constexpr double kRadius = 40.0;
  std::vector<TorcsStation> stations;
  constexpr int kCount = 300;
  for (int i = 0; i <= kCount; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kCount;
    stations.push_back(
        {.p_T = {kRadius * std::sin(angle), -kRadius * std::cos(angle)}, .yaw_T_rad = angle});
  }
  for (const double to_left : {-3.0, 0.0, 2.5}) {
    const Path lane = MakeTorcsLane(stations, to_left);
    EXPECT_TRUE(lane.is_closed);
    const double length = 2.0 * std::numbers::pi * (kRadius - to_left);
    EXPECT_NEAR(static_cast<double>(lane.points.size()), length, 1.0);
    for (std::size_t i = 0; i < lane.points.size(); ++i) {
      // Smoothing cuts the corner by sigma^2 / (2 r).
      EXPECT_NEAR(lane.points[i].norm(), kRadius - to_left, 0.08);
      const Eigen::Vector2d step = lane.points[(i + 1) % lane.points.size()] - lane.points[i];
      EXPECT_NEAR(step.norm(), 1.0, 0.02);
    }
  }
}

TEST(MakeTorcsLane, ChangesCurvatureGradually) {
  const auto layout = ParseTorcsLayout(TorcsTestTrack::Layout(), "a.xml");
  ASSERT_TRUE(layout);
  const Path lane = MakeTorcsLane(layout->stations, -2.5);
  const std::size_t count = lane.points.size();
  double before = 0.0;
  double largest = 0.0;
  for (std::size_t i = 0; i <= count; ++i) {
    const Eigen::Vector2d a = lane.points[(i + 1) % count] - lane.points[i % count];
    const Eigen::Vector2d b = lane.points[(i + 2) % count] - lane.points[(i + 1) % count];
    const double curvature =
        std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b)) / (0.5 * (a.norm() + b.norm()));
    if (i > 0) {
      EXPECT_LT(std::abs(curvature - before), 0.012) << i;
    }
    before = curvature;
    largest = std::max(largest, curvature);
  }
  EXPECT_NEAR(largest, 1.0 / 27.5, 0.002);
}

TEST(Reversed, GoesTheOtherWay) {
  const Path path{.points = {{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}}, .is_closed = true};
  const Path reversed = Reversed(path);
  EXPECT_TRUE(reversed.is_closed);
  EXPECT_EQ(reversed.points.front(), Eigen::Vector2d(1.0, 1.0));
  EXPECT_EQ(reversed.points.back(), Eigen::Vector2d(0.0, 0.0));
}

}  // namespace
}  // namespace relocd
