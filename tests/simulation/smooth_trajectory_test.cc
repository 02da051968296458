#include "simulation/smooth_trajectory.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"

namespace relocd {
namespace {

constexpr std::int64_t kStepNs = 50'000'000;

/// Half a minute of bends and changes of speed, sometimes backwards, without any sideways motion.
Trajectory2 WindingDrive() {
  Trajectory2 X_WBs;
  Pose2 X_WB(3.0, -2.0, 2.5);
  for (int i = 0; i < 600; ++i) {
    X_WBs.push_back({.time_ns = i * kStepNs, .X_WB = X_WB});
    const double t = 0.05 * i;
    const double speed = 0.8 + 1.0 * std::sin(0.3 * t);
    const double yaw_rate = 0.6 * std::sin(0.17 * t) + 0.2 * std::cos(0.9 * t);
    X_WB = X_WB * Pose2::Exp(0.05 * Eigen::Vector3d(speed, 0.0, yaw_rate));
  }
  return X_WBs;
}

TEST(SmoothTrajectoryTest, PassesThroughThePosesWithoutJumpsOfVelocity) {
  const Trajectory2 X_WBs = WindingDrive();
  const SmoothTrajectory smooth(X_WBs);
  for (const TimedPose2& pose : X_WBs) {
    const Pose2 error = smooth.At(pose.time_ns).Inverse() * pose.X_WB;
    EXPECT_THAT(error.Log(), IsNear(Eigen::Vector3d(Eigen::Vector3d::Zero()), 1e-9));
    const auto step = [&](std::int64_t from_ns, std::int64_t to_ns) {
      return (smooth.At(from_ns).Inverse() * smooth.At(to_ns)).Log();
    };
    if (pose.time_ns == smooth.begin_ns() || pose.time_ns == smooth.end_ns()) continue;
    const Eigen::Vector3d before = step(pose.time_ns - 100'000, pose.time_ns);
    const Eigen::Vector3d after = step(pose.time_ns, pose.time_ns + 100'000);
    EXPECT_THAT(after, IsNear(before, 2e-7));
  }
}

}  // namespace
}  // namespace relocd
