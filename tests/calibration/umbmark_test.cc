#include "calibration/umbmark.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "odometry/differential_drive.h"
#include "support/random.h"

namespace relocd {
namespace {

constexpr double kSideM = 4.0;
constexpr double kTrackM = 0.5;

/// A robot whose wheels and track are not as its odometry has them.
struct Robot {
  double left = 1.0;  ///< True travel of what odometry measures.
  double right = 1.0;
  double track_m = kTrackM;
};

/// Drives a square by its odometry, which then says that it is back, and gives where it truly is.
SquareRun DriveSquare(const Robot& robot, bool clockwise, double noise, TestRandom& random) {
  Pose2 X_WB;
  Pose2 X_OB;
  const auto move = [&](double left_m, double right_m) {
    const Eigen::Vector2d measured(left_m, right_m);
    const Eigen::Vector2d truly(robot.left * left_m * (1.0 + random.Normal(noise)),
                                robot.right * right_m * (1.0 + random.Normal(noise)));
    X_OB = X_OB * Pose2::Exp(BodyTwist(kTrackM, measured));
    X_WB = X_WB * Pose2::Exp(BodyTwist(robot.track_m, truly));
  };
  const double corner_m = 0.25 * std::numbers::pi * kTrackM * (clockwise ? -1.0 : 1.0);
  for (int side = 0; side < 4; ++side) {
    move(kSideM, kSideM);
    move(-corner_m, corner_m);
  }
  EXPECT_NEAR(X_OB.translation().norm(), 0.0, 1e-9);
  return {.clockwise = clockwise, .error_m = X_WB.translation() - X_OB.translation()};
}

std::vector<SquareRun> DriveTen(const Robot& robot, double noise, unsigned seed) {
  TestRandom random(seed);
  std::vector<SquareRun> runs;
  for (int i = 0; i < 10; ++i)
    runs.push_back(DriveSquare(robot, i % 2 == 0, noise, random));
  return runs;
}

double ErrorAfter(const Robot& robot, const Umbmark& found) {
  // What odometry measured is corrected; the robot stays as it is.
  const Robot corrected{.left = robot.left / found.left_scale,
                        .right = robot.right / found.right_scale,
                        .track_m = robot.track_m * kTrackM / (kTrackM * found.track_factor)};
  return EvaluateUmbmark(DriveTen(corrected, 0.0, 1), kSideM, kTrackM).value().largest_error_m;
}

class UmbmarkTest : public testing::TestWithParam<Robot> {};

TEST_P(UmbmarkTest, CorrectsWheelsAndTrack) {
  const auto found = EvaluateUmbmark(DriveTen(GetParam(), 0.0, 1), kSideM, kTrackM);
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_NEAR(found->track_factor, GetParam().track_m / kTrackM, 0.002);
  EXPECT_NEAR(found->right_scale / found->left_scale,
              GetParam().right / GetParam().left,
              5e-4);  // to first order
  EXPECT_GT(found->largest_error_m, 10.0 * ErrorAfter(GetParam(), *found));
}

INSTANTIATE_TEST_SUITE_P(Robots,
                         UmbmarkTest,
                         testing::Values(Robot{.track_m = 0.51},
                                         Robot{.track_m = 0.49},
                                         Robot{.left = 0.998, .right = 1.002},
                                         Robot{.left = 1.001, .right = 0.999},
                                         Robot{.left = 0.998, .right = 1.002, .track_m = 0.508}));

TEST(UmbmarkTest, TellsItsSpread) {
  const Robot robot{.left = 0.998, .right = 1.002, .track_m = 0.508};
  const auto ratio_of = [](const Umbmark& found) { return found.right_scale / found.left_scale; };
  // Without noise there is what the method's first order leaves.
  const double expected =
      ratio_of(EvaluateUmbmark(DriveTen(robot, 0.0, 1), kSideM, kTrackM).value());
  double squared = 0.0;
  constexpr int kSeeds = 200;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const auto found = EvaluateUmbmark(DriveTen(robot, 0.001, seed), kSideM, kTrackM).value();
    squared += std::pow((ratio_of(found) - expected) / found.ratio_sigma, 2);
  }
  EXPECT_NEAR(std::sqrt(squared / kSeeds), 1.1, 0.25);  // ten runs: Student's t
}

TEST(UmbmarkTest, RefusesARunThatEndsFurtherOffThanASideIsLong) {
  const auto found = EvaluateUmbmark(
      {{.clockwise = true, .error_m = {0.1, 0.0}}, {.clockwise = false, .error_m = {3.0, 4.0}}},
      4.0,
      0.5);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().message,
            "run 2 ends 5 m from where odometry has it, must be below the side of 4 m");
}

TEST(UmbmarkTest, NeedsBothDirections) {
  const auto found = EvaluateUmbmark({{.clockwise = true}}, kSideM, kTrackM);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().message,
            "1 runs clockwise and 0 counter-clockwise, must be at least one of each, better five");
  EXPECT_FALSE(EvaluateUmbmark({{.clockwise = true}, {.clockwise = false}}, 0.0, kTrackM));
}

}  // namespace
}  // namespace relocd
