#include "simulation/smooth_trajectory.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulation/winding_drive.h"
#include "support/eigen_matchers.h"

namespace relocd {
namespace {

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
