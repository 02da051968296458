#include <cmath>
#include <numbers>

#include <Eigen/Core>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/covariance.h"
#include "smoothing/absolute_pose_residual.h"
#include "smoothing/motion_covariance.h"
#include "smoothing/relative_pose_residual.h"
#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

constexpr int kTrials = 200;

/// Symmetric, positive definite and far from diagonal.
Eigen::Matrix3d CorrelatedCovariance(TestRandom& random) {
  Eigen::Matrix3d factor;
  for (double& value : factor.reshaped())
    value = random.Uniform(-1.0, 1.0);
  return factor * factor.transpose() + 0.1 * Eigen::Matrix3d::Identity();
}

/// The pose as a parameter block, its yaw left unwrapped by a number of turns.
Eigen::Vector3d Block(const Pose2& pose, int turns = 0) {
  return {pose.x(), pose.y(), pose.yaw() + turns * 2.0 * std::numbers::pi};
}

double SquaredNorm(const RelativePoseResidual& residual,
                   const Eigen::Vector3d& x_WA,
                   const Eigen::Vector3d& x_WB) {
  return SquaredMahalanobis(residual.Linearize(x_WA, x_WB).error, residual.covariance());
}

double SquaredNorm(const AbsolutePoseResidual& residual, const Eigen::Vector3d& x_WK) {
  const Eigen::Vector3d error = residual.Linearize(x_WK).error;
  return error.dot(residual.information() * error);
}

TEST(RelativePoseResidualTest, IsZeroForTheMeasuredMotionAlsoAcrossPi) {
  TestRandom random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_WA = random.Pose();
    const Pose2 X_AB = random.Pose();
    const RelativePoseResidual residual(X_AB, CorrelatedCovariance(random));
    const Eigen::Vector3d error = residual.Linearize(Block(X_WA, 2), Block(X_WA * X_AB, -1)).error;
    EXPECT_THAT(error, IsNear(Eigen::Vector3d(0.0, 0.0, 0.0), 1e-9)) << X_WA << " " << X_AB;
  }
}

/// Small, so that a perturbation's tangent and its translation are the same to first order.
Eigen::Vector3d SmallPerturbation(TestRandom& random) {
  return {random.Uniform(-1e-5, 1e-5), random.Uniform(-1e-5, 1e-5), random.Uniform(-1e-5, 1e-5)};
}

TEST(RelativePoseResidualTest, SquaresToTheMahalanobisDistanceOfACorrelatedCovariance) {
  TestRandom random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_WA = random.Pose();
    const Pose2 X_AB = random.Pose();
    const Eigen::Matrix3d covariance = CorrelatedCovariance(random);
    const Eigen::Vector3d perturbation = SmallPerturbation(random);
    const Pose2 X_WB = X_WA * X_AB * Pose2::Exp(perturbation);
    const double expected = SquaredMahalanobis(perturbation, covariance);
    EXPECT_NEAR(SquaredNorm(RelativePoseResidual(X_AB, covariance), Block(X_WA), Block(X_WB)),
                expected,
                1e-4 * expected + 1e-16);
  }
}

TEST(AbsolutePoseResidualTest, SquaresToTheMahalanobisDistanceOfACorrelatedCovariance) {
  TestRandom random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_WM = random.Pose();
    const Pose2 X_KF = random.Pose();
    const Eigen::Matrix3d covariance = CorrelatedCovariance(random);
    const Eigen::Vector3d perturbation = SmallPerturbation(random);
    const Pose2 X_WK = X_WM * Pose2::Exp(perturbation) * X_KF.Inverse();
    const double expected = SquaredMahalanobis(perturbation, covariance);
    EXPECT_NEAR(SquaredNorm(AbsolutePoseResidual::OfPose(X_WM, X_KF, covariance), Block(X_WK, 1)),
                expected,
                1e-4 * expected + 1e-16);
  }
}

TEST(AbsolutePoseResidualTest, OfAPositionWeighsAlongTheMapsAxesAndNoHeading) {
  const Eigen::Matrix2d covariance = Eigen::Vector2d(4.0, 0.25).asDiagonal();
  const auto residual =
      AbsolutePoseResidual::OfPosition({10.0, 20.0}, Pose2(1.0, 0.0, 0.0), covariance);
  // K at (12, 19) looks along +y: F is at (12, 20), 2 m from the measurement along x.
  const Pose2 X_WK(12.0, 19.0, std::numbers::pi / 2.0);
  EXPECT_NEAR(SquaredNorm(residual, Block(X_WK)), 1.0, 1e-12);
}

constexpr double kStep = 1e-6;

/// Central differences of a function of a pose.
template <typename Function>
Eigen::Matrix3d Differences(const Eigen::Vector3d& x, Function function) {
  Eigen::Matrix3d result;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(i);
    result.col(i) = (function(x + step) - function(x - step)) / (2.0 * kStep);
  }
  return result;
}

TEST(RelativePoseResidualTest, DerivativesAgreeWithDifferences) {
  TestRandom random(4);
  for (int trial = 0; trial < kTrials; ++trial) {
    const RelativePoseResidual residual(random.Pose(), CorrelatedCovariance(random));
    const Eigen::Vector3d x_WA = Block(random.Pose());
    const Eigen::Vector3d x_WB = Block(random.Pose());
    const auto at = residual.Linearize(x_WA, x_WB);
    if (std::abs(at.error.z()) > 0.99 * std::numbers::pi) continue;  // wraps in between
    const double tolerance = 1e-6 * (1.0 + (x_WB - x_WA).norm());
    EXPECT_THAT(at.by_A,
                IsNear(Differences(x_WA,
                                   [&](const Eigen::Vector3d& x) {
                                     return residual.Linearize(x, x_WB).error;
                                   }),
                       tolerance));
    EXPECT_THAT(at.by_B,
                IsNear(Differences(x_WB,
                                   [&](const Eigen::Vector3d& x) {
                                     return residual.Linearize(x_WA, x).error;
                                   }),
                       tolerance));
  }
}

TEST(AbsolutePoseResidualTest, DerivativesAgreeWithDifferences) {
  TestRandom random(5);
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto residual =
        AbsolutePoseResidual::OfPose(random.Pose(), random.Pose(), CorrelatedCovariance(random));
    const Eigen::Vector3d x_WK = Block(random.Pose());
    const auto at = residual.Linearize(x_WK);
    if (std::abs(at.error.z()) > 0.99 * std::numbers::pi) continue;  // wraps in between
    EXPECT_THAT(
        at.by_K,
        IsNear(Differences(x_WK,
                           [&](const Eigen::Vector3d& x) { return residual.Linearize(x).error; }),
               1e-4));
  }
}

TEST(ComposeCovarianceTest, TurnsAHeadingErrorIntoOneToTheSide) {
  // A heading sigma of 0.01 rad, 100 m on, is 1 m to the side.
  Eigen::Matrix3d covariance_AB = 1e-6 * Eigen::Matrix3d::Identity();
  covariance_AB(2, 2) = 1e-4;
  const Eigen::Matrix3d covariance_BC = 1e-6 * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d covariance =
      ComposeCovariance(covariance_AB, Pose2(100.0, 0.0, 0.0), covariance_BC);
  EXPECT_NEAR(std::sqrt(covariance(0, 0)), 0.0, 2e-3);
  EXPECT_NEAR(std::sqrt(covariance(1, 1)), 1.0, 1e-3);
  EXPECT_NEAR(std::sqrt(covariance(2, 2)), 0.01, 1e-3);
}

}  // namespace
}  // namespace relocd
