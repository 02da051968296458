#include "geometry/trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

using testing::HasSubstr;

TEST(TrajectoryTest, ReadsBackWhatItFormats) {
  TestRandom random(1);
  Trajectory3 trajectory;
  for (int i = 0; i < 100; ++i)
    trajectory.push_back({i * 100'000'000LL, random.SpatialPose()});
  const auto read = ParseTumTrajectory(FormatTumTrajectory(trajectory), "x.txt");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), trajectory.size());
  for (std::size_t i = 0; i < read->size(); ++i) {
    EXPECT_EQ((*read)[i].time_ns, trajectory[i].time_ns);
    EXPECT_THAT(((*read)[i].X_WB.Inverse() * trajectory[i].X_WB).Log(),
                IsNear(Vector6d(Vector6d::Zero()), 1e-7));
  }
}

TEST(TrajectoryTest, NamesFileAndLineOfWhatItCannotRead) {
  EXPECT_THAT(ParseTumTrajectory("# t\n0 1 2 3 0 0 0 1\n1 2 3\n", "x.txt").error().message,
              HasSubstr("x.txt: line 3: is '1 2 3', must be 'time_s tx ty tz qx qy qz qw'"));
  EXPECT_THAT(ParseTumTrajectory("0 1 2 nan 0 0 0 1\n", "x.txt").error().message,
              HasSubstr("x.txt: line 1"));
  EXPECT_THAT(ParseTumTrajectory("0 1 2 3 0 0 0 0\n", "x.txt").error().message,
              HasSubstr("the quaternion's length is 0"));
  EXPECT_THAT(ParseTumTrajectory("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "x.txt").error().message,
              HasSubstr("x.txt: line 2: the time is 1 s, must be above"));
}

TEST(TrajectoryTest, InterpolatesAlongTheArcBetweenNeighbours) {
  const double quarter = 1.5707963267948966;
  const Trajectory2 trajectory{{0, Pose2()}, {1000, Pose2::Exp({2.0 * quarter, 0.0, quarter})}};
  const auto middle = Interpolate(trajectory, 500, 1000);
  ASSERT_TRUE(middle.has_value());
  // Half of a quarter circle of radius 2.
  EXPECT_NEAR(middle->x(), 2.0 * std::sin(quarter / 2.0), 1e-9);
  EXPECT_NEAR(middle->y(), 2.0 - 2.0 * std::cos(quarter / 2.0), 1e-9);
  EXPECT_NEAR(middle->yaw(), quarter / 2.0, 1e-9);
}

TEST(TrajectoryTest, GivesNothingOutsideAndInGaps) {
  const Trajectory2 trajectory{{100, Pose2()}, {200, Pose2(1, 0, 0)}, {900, Pose2(2, 0, 0)}};
  EXPECT_FALSE(Interpolate(trajectory, 99, 1000).has_value());
  EXPECT_FALSE(Interpolate(trajectory, 901, 1000).has_value());
  EXPECT_FALSE(Interpolate(trajectory, 500, 300).has_value());
  EXPECT_TRUE(Interpolate(trajectory, 100, 300).has_value());
  EXPECT_TRUE(Interpolate(trajectory, 900, 300).has_value());
  EXPECT_FALSE(Interpolate(Trajectory2(), 0, 1000).has_value());
}

}  // namespace
}  // namespace relocd
