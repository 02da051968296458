#include "geometry/planar.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

/// A pose of a vehicle on uneven ground.
Pose3 TiltedPose(TestRandom& random) {
  return {RotationFromRollPitchYaw(
              random.Uniform(-0.2, 0.2), random.Uniform(-0.2, 0.2), random.Uniform(-3.1, 3.1)),
          random.Point3()};
}

Matrix6d SomeCovariance(TestRandom& random) {
  Matrix6d root;
  for (int i = 0; i < root.size(); ++i)
    root(i) = random.Uniform(-0.1, 0.1);
  return root * root.transpose() + 1e-4 * Matrix6d::Identity();
}

TEST(PlanarTest, LiftingAndProjectingGivesThePoseBack) {
  TestRandom random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    const Pose2 X_WB = random.Pose();
    EXPECT_THAT((X_WB.Inverse() * ProjectToPlane(LiftFromPlane(X_WB))).Log(),
                IsNear(Eigen::Vector3d(Eigen::Vector3d::Zero()), 1e-9));
  }
}

TEST(PlanarTest, ProjectsTheCovarianceByTheDerivativeOfTheProjection) {
  TestRandom random(2);
  constexpr double kStep = 1e-6;
  for (int trial = 0; trial < 200; ++trial) {
    const Pose3 X_WB = TiltedPose(random);
    const Pose2 planar = ProjectToPlane(X_WB);
    Eigen::Matrix<double, 3, 6> jacobian;
    for (int i = 0; i < 6; ++i) {
      const Pose2 moved = ProjectToPlane(X_WB * Pose3::Exp(kStep * Vector6d::Unit(i)));
      jacobian.col(i) = (planar.Inverse() * moved).Log() / kStep;
    }
    const Matrix6d covariance = SomeCovariance(random);
    EXPECT_THAT(ProjectToPlane(X_WB, covariance).covariance,
                IsNear(Eigen::Matrix3d(jacobian * covariance * jacobian.transpose()), 1e-6));
  }
}

TEST(PlanarTest, TransportsTheCamerasCovarianceToTheBody) {
  TestRandom random(3);
  constexpr double kStep = 1e-6;
  for (int trial = 0; trial < 200; ++trial) {
    const Pose3 X_WC = random.SpatialPose();
    const Pose3 X_BC = random.SpatialPose();
    const Pose3 X_WB = X_WC * X_BC.Inverse();
    Matrix6d jacobian;
    for (int i = 0; i < 6; ++i) {
      const Pose3 moved = X_WC * Pose3::Exp(kStep * Vector6d::Unit(i)) * X_BC.Inverse();
      jacobian.col(i) = (X_WB.Inverse() * moved).Log() / kStep;
    }
    const Matrix6d covariance = SomeCovariance(random);
    EXPECT_THAT(TransportCovariance(covariance, X_BC),
                IsNear(Matrix6d(jacobian * covariance * jacobian.transpose()), 1e-3));
  }
}

}  // namespace
}  // namespace relocd
