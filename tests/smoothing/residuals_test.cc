#include <array>
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

template <int Size, typename Residual, typename... Blocks>
Eigen::Matrix<double, Size, 1> Evaluate(const Residual& residual, const Blocks&... blocks) {
  Eigen::Matrix<double, Size, 1> value;
  EXPECT_TRUE(residual(blocks.data()..., value.data()));
  return value;
}

TEST(RelativePoseResidualTest, IsZeroForTheMeasuredMotionAlsoAcrossPi) {
  TestRandom random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_WA = random.Pose();
    const Pose2 X_AB = random.Pose();
    const RelativePoseResidual residual(X_AB, CorrelatedCovariance(random));
    const Eigen::Vector3d value = Evaluate<3>(residual, Block(X_WA, 2), Block(X_WA * X_AB, -1));
    EXPECT_THAT(value, IsNear(Eigen::Vector3d(0.0, 0.0, 0.0), 1e-9)) << X_WA << " " << X_AB;
  }
}

TEST(RelativePoseResidualTest, SquaresToTheMahalanobisDistanceOfACorrelatedCovariance) {
  TestRandom random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_WA = random.Pose();
    const Pose2 X_AB = random.Pose();
    const Eigen::Matrix3d covariance = CorrelatedCovariance(random);
    // Small, so that the perturbation's tangent and its translation are the same to first order.
    const Eigen::Vector3d perturbation(
        random.Uniform(-1e-5, 1e-5), random.Uniform(-1e-5, 1e-5), random.Uniform(-1e-5, 1e-5));
    const Pose2 X_WB = X_WA * X_AB * Pose2::Exp(perturbation);
    const Eigen::Vector3d value =
        Evaluate<3>(RelativePoseResidual(X_AB, covariance), Block(X_WA), Block(X_WB));
    const double expected = SquaredMahalanobis(perturbation, covariance);
    EXPECT_NEAR(value.squaredNorm(), expected, 1e-4 * expected + 1e-16);
  }
}

TEST(AbsolutePoseResidualTest, SquaresToTheMahalanobisDistanceOfACorrelatedCovariance) {
  TestRandom random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_WM = random.Pose();
    const Pose2 X_KF = random.Pose();
    const Eigen::Matrix3d covariance = CorrelatedCovariance(random);
    const Eigen::Vector3d perturbation(
        random.Uniform(-1e-5, 1e-5), random.Uniform(-1e-5, 1e-5), random.Uniform(-1e-5, 1e-5));
    const Pose2 X_WK = X_WM * Pose2::Exp(perturbation) * X_KF.Inverse();
    const Eigen::Vector3d value =
        Evaluate<3>(AbsolutePoseResidual(X_WM, X_KF, covariance), Block(X_WK, 1));
    const double expected = SquaredMahalanobis(perturbation, covariance);
    EXPECT_NEAR(value.squaredNorm(), expected, 1e-4 * expected + 1e-16);
  }
}

TEST(AbsolutePositionResidualTest, WeighsAlongTheMapsAxes) {
  const Eigen::Matrix2d covariance = Eigen::Vector2d(4.0, 0.25).asDiagonal();
  const AbsolutePositionResidual residual({10.0, 20.0}, {1.0, 0.0}, covariance);
  // K at (12, 19) looks along +y: F is at (12, 20), 2 m from the measurement along x.
  const Pose2 X_WK(12.0, 19.0, std::numbers::pi / 2.0);
  EXPECT_THAT(Evaluate<2>(residual, Block(X_WK)), IsNear(Eigen::Vector2d(1.0, 0.0), 1e-12));
}

/// The Jacobians that Ceres sees agree with central differences.
TEST(ResidualsTest, DerivativesAgreeWithDifferences) {
  TestRandom random(4);
  constexpr double kStep = 1e-6;
  for (int trial = 0; trial < kTrials; ++trial) {
    const RelativePoseResidual::CostFunction cost(
        new RelativePoseResidual(random.Pose(), CorrelatedCovariance(random)));
    Eigen::Matrix<double, 6, 1> x;
    x << Block(random.Pose()), Block(random.Pose());
    const std::array<const double*, 2> blocks{x.data(), x.data() + 3};
    Eigen::Vector3d value;
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_A;
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_B;
    std::array<double*, 2> jacobians{by_A.data(), by_B.data()};
    ASSERT_TRUE(cost.Evaluate(blocks.data(), value.data(), jacobians.data()));
    if (std::abs(value.z()) > 0.9 * std::numbers::pi) continue;  // the angle wraps in between
    for (int i = 0; i < 6; ++i) {
      const double kept = x(i);
      Eigen::Vector3d above;
      Eigen::Vector3d below;
      x(i) = kept + kStep;
      ASSERT_TRUE(cost.Evaluate(blocks.data(), above.data(), nullptr));
      x(i) = kept - kStep;
      ASSERT_TRUE(cost.Evaluate(blocks.data(), below.data(), nullptr));
      x(i) = kept;
      const Eigen::Vector3d expected = (above - below) / (2.0 * kStep);
      const Eigen::Vector3d column = i < 3 ? by_A.col(i) : by_B.col(i - 3);
      const double jump = (above - below).norm();
      if (jump > 1.0) continue;  // across the wrap
      EXPECT_THAT(column, IsNear(expected, 1e-5 * (1.0 + expected.norm())));
    }
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
