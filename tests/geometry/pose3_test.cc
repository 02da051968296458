#include "geometry/pose3.h"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

constexpr int kTrials = 1000;
constexpr double kTolerance = 1e-9;

Vector6d Tangent(TestRandom& random, double rotation_scale) {
  Vector6d tangent;
  tangent.head<3>() = random.Point3();
  tangent.tail<3>() = rotation_scale * (random.Rotation() * Eigen::Vector3d::UnitX());
  return tangent;
}

TEST(Pose3Test, CompositionAgreesWithMappingTwice) {
  TestRandom random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose3 X_AB = random.SpatialPose();
    const Pose3 X_BC = random.SpatialPose();
    const Eigen::Vector3d p_CQ = random.Point3();
    EXPECT_THAT((X_AB * X_BC) * p_CQ, IsNear(Eigen::Vector3d(X_AB * (X_BC * p_CQ)), kTolerance));
  }
}

TEST(Pose3Test, InverseUndoes) {
  TestRandom random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose3 X_AB = random.SpatialPose();
    const Eigen::Vector3d p_BQ = random.Point3();
    EXPECT_THAT(X_AB.Inverse() * (X_AB * p_BQ), IsNear(p_BQ, kTolerance));
  }
}

TEST(Pose3Test, ExpUndoesLogForSmallAndLargeTurns) {
  TestRandom random(3);
  for (const double scale : {1e-12, 1e-6, 1e-5, 1e-4, 1e-3, 1.0, 3.0}) {
    for (int trial = 0; trial < kTrials; ++trial) {
      const Vector6d tangent = Tangent(random, scale);
      EXPECT_THAT(Pose3::Exp(tangent).Log(), IsNear(tangent, 1e-7)) << scale;
    }
  }
}

TEST(Pose3Test, AdjointMovesAPerturbationToTheLeft) {
  TestRandom random(4);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose3 X = random.SpatialPose();
    const Vector6d delta = Tangent(random, 0.5);
    const Pose3 right = X * Pose3::Exp(delta);
    const Pose3 left = Pose3::Exp(X.Adjoint() * delta) * X;
    EXPECT_THAT((left.Inverse() * right).Log(), IsNear(Vector6d(Vector6d::Zero()), 1e-8));
  }
}

TEST(Pose3Test, RollPitchYawTurnAboutFixedAxesInThatOrder) {
  const double quarter = std::numbers::pi / 2.0;
  // A camera that looks along the body's x axis: its z axis is the body's x, its x axis the body's
  // -y.
  const Eigen::Matrix3d R_BC = RotationFromRollPitchYaw(-quarter, 0.0, -quarter);
  EXPECT_THAT(R_BC.col(2), IsNear(Eigen::Vector3d(1.0, 0.0, 0.0), kTolerance));
  EXPECT_THAT(R_BC.col(0), IsNear(Eigen::Vector3d(0.0, -1.0, 0.0), kTolerance));
}

}  // namespace
}  // namespace relocd
