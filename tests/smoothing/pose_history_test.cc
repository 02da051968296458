#include "smoothing/pose_history.h"

#include <chrono>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smoothing/motion_covariance.h"
#include "support/eigen_matchers.h"

namespace relocd {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// One sample a second of a body that drives straight on at 1 m/s, the first at t = 0.
PoseHistory StraightDrive(int samples) {
  PoseHistory history(seconds(10), milliseconds(500));
  OdometrySample sample;
  sample.step_covariance = Eigen::Vector3d(0.01, 0.01, 0.0001).asDiagonal();
  for (int i = 0; i < samples; ++i) {
    sample.time = MonotonicTime(seconds(i));
    sample.X_OB = Pose2(i, 0.0, 0.0);
    sample.X_KB = sample.X_OB;
    if (i > 0) {
      sample.covariance_KB =
          ComposeCovariance(sample.covariance_KB, Pose2(1.0, 0.0, 0.0), sample.step_covariance);
    }
    history.Push(sample);
  }
  return history;
}

TEST(PoseHistoryTest, InterpolatesPoseAndCovariance) {
  const PoseHistory history = StraightDrive(4);
  const auto sample = history.At(MonotonicTime(milliseconds(1500)));
  ASSERT_TRUE(sample);
  EXPECT_NEAR(sample->X_OB.x(), 1.5, 1e-12);
  EXPECT_NEAR(sample->X_KB.x(), 1.5, 1e-12);
  EXPECT_NEAR(sample->covariance_KB(0, 0), 0.015, 1e-12);
  EXPECT_FALSE(sample->is_extrapolated);
}

TEST(PoseHistoryTest, MovesOnWithTheLastVelocityForAWhile) {
  const PoseHistory history = StraightDrive(4);
  const auto sample = history.At(MonotonicTime(milliseconds(3250)));
  ASSERT_TRUE(sample);
  EXPECT_NEAR(sample->X_OB.x(), 3.25, 1e-12);
  EXPECT_TRUE(sample->is_extrapolated);
  EXPECT_FALSE(history.At(MonotonicTime(milliseconds(3501))));
}

TEST(PoseHistoryTest, ForgetsWhatIsOlderThanItsReach) {
  const PoseHistory history = StraightDrive(30);
  EXPECT_FALSE(history.At(MonotonicTime(seconds(17))));
  EXPECT_TRUE(history.At(MonotonicTime(seconds(20))));
}

TEST(PoseHistoryTest, KnowsNothingBeforeItsFirstSample) {
  EXPECT_FALSE(PoseHistory(seconds(10), seconds(1)).At(MonotonicTime(seconds(0))));
  EXPECT_FALSE(StraightDrive(2).At(MonotonicTime(seconds(-1))));
}

TEST(PoseHistoryTest, KnowsTheVelocityAlongTheBodysAxes) {
  PoseHistory history(seconds(10), milliseconds(500));
  EXPECT_FALSE(history.VelocityAt(MonotonicTime(seconds(1))));
  OdometrySample sample;
  sample.time = MonotonicTime(seconds(1));
  history.Push(sample);
  EXPECT_FALSE(history.VelocityAt(sample.time));
  for (int i = 0; i < 20; ++i) {
    sample.time += milliseconds(100);
    sample.X_OB = sample.X_OB * Pose2::Exp({0.2, 0.0, 0.05});
    history.Push(sample);
  }
  for (const int ms : {1000, 2000, 2950, 3300}) {
    const auto velocity = history.VelocityAt(MonotonicTime(milliseconds(ms)));
    ASSERT_TRUE(velocity) << ms;
    EXPECT_LT((*velocity - Eigen::Vector3d(2.0, 0.0, 0.5)).norm(), 1e-9) << ms;
  }
  sample.time += milliseconds(100);
  sample.X_OB = Pose2(1e6, 0.0, 0.0);
  history.Push(sample);
  EXPECT_FALSE(history.VelocityAt(sample.time));
}

}  // namespace
}  // namespace relocd
