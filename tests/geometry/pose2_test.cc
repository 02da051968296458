#include "geometry/pose2.h"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

constexpr int kTrials = 1000;
constexpr double kTolerance = 1e-9;

TEST(Pose2Test, MapsAPointOfBIntoA) {
  const Pose2 X_AB(1.0, 2.0, std::numbers::pi / 2.0);
  EXPECT_THAT(X_AB * Eigen::Vector2d(3.0, 0.0), IsNear(Eigen::Vector2d(1.0, 5.0), kTolerance));
}

TEST(Pose2Test, KeepsYawInTheHalfOpenInterval) {
  EXPECT_DOUBLE_EQ(Pose2(0.0, 0.0, std::numbers::pi).yaw(), -std::numbers::pi);
  EXPECT_DOUBLE_EQ(Pose2(0.0, 0.0, -std::numbers::pi).yaw(), -std::numbers::pi);
  EXPECT_NEAR(Pose2(0.0, 0.0, 7.0).yaw(), 7.0 - 2.0 * std::numbers::pi, kTolerance);
}

TEST(Pose2Test, CompositionAgreesWithMappingTwice) {
  TestRandom random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_AB = random.Pose();
    const Pose2 X_BC = random.Pose();
    const Eigen::Vector2d p_CQ = random.Point();
    EXPECT_THAT((X_AB * X_BC) * p_CQ, IsNear(Eigen::Vector2d(X_AB * (X_BC * p_CQ)), kTolerance))
        << X_AB << " " << X_BC;
  }
}

TEST(Pose2Test, InverseUndoes) {
  TestRandom random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_AB = random.Pose();
    EXPECT_THAT((X_AB * X_AB.Inverse()).Log(), IsNear(Eigen::Vector3d(0.0, 0.0, 0.0), kTolerance))
        << X_AB;
  }
}

TEST(Pose2Test, ExpUndoesLogForSmallAndLargeTurns) {
  TestRandom random(3);
  for (const double scale : {1e-12, 1e-6, 1e-5, 1e-3, 1.0, 3.0}) {
    for (int trial = 0; trial < kTrials; ++trial) {
      const Eigen::Vector3d tangent(
          random.Uniform(-5.0, 5.0), random.Uniform(-5.0, 5.0), scale * random.Uniform(-1.0, 1.0));
      EXPECT_THAT(Pose2::Exp(tangent).Log(), IsNear(tangent, kTolerance));
    }
  }
}

TEST(Pose2Test, ExpOfAQuarterTurnIsAQuarterCircle) {
  const double radius_m = 2.0;
  const Pose2 pose = Pose2::Exp({radius_m * std::numbers::pi / 2.0, 0.0, std::numbers::pi / 2.0});
  EXPECT_THAT(pose.translation(), IsNear(Eigen::Vector2d(radius_m, radius_m), kTolerance));
}

TEST(Pose2Test, AdjointMovesAPerturbationToTheLeft) {
  TestRandom random(4);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_AB = random.Pose();
    const Eigen::Vector3d delta(0.1, -0.2, 0.3);
    const Pose2 right = X_AB * Pose2::Exp(delta);
    const Pose2 left = Pose2::Exp(X_AB.Adjoint() * delta) * X_AB;
    EXPECT_THAT((left.Inverse() * right).Log(), IsNear(Eigen::Vector3d(0.0, 0.0, 0.0), 1e-8));
  }
}

}  // namespace
}  // namespace relocd
