#include "smoothing/keyframe_window.h"

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <ceres/covariance.h>
#include <ceres/problem.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smoothing/absolute_pose_residual.h"
#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

/// So wide a kernel is none: the problem is one of least squares.
const FixWeighting kQuadratic(1e6, 0.0);

/// A bent chain with a prior and a fix on every third keyframe, all of which err.
KeyframeWindow MakeWindow(int keyframes, unsigned seed) {
  TestRandom random(seed);
  const auto error = [&random](double size) {
    return Pose2::Exp({random.Uniform(-size, size), random.Uniform(-size, size), 0.1 * size});
  };
  KeyframeWindow window;
  Pose2 X_WK(3.0, 4.0, 3.0);
  window.prior = PlanarPose{.X_WB = X_WK * error(0.3),
                            .covariance = Eigen::Vector3d(0.2, 0.1, 0.01).asDiagonal()};
  for (int i = 0; i < keyframes; ++i) {
    Keyframe keyframe;
    keyframe.id = i;
    keyframe.time = MonotonicTime(std::chrono::seconds(i));
    const Pose2 X_PK = Pose2::Exp({0.5, 0.01, 0.1});
    if (i > 0) X_WK = X_WK * X_PK;
    keyframe.SetX_WK(X_WK);
    keyframe.X_PK = X_PK * error(0.02);
    keyframe.covariance_PK << 4e-4, 1e-4, 0.0, 1e-4, 2e-4, 1e-5, 0.0, 1e-5, 1e-4;
    if (i > 0) keyframe.motion_residual = MakeMotionResidual(keyframe);
    window.keyframes.push_back(std::move(keyframe));
    if (i % 3 != 0) continue;
    AttachedFix fix;
    fix.keyframe_id = i;
    fix.fix.time = window.keyframes.back().time;
    fix.fix.has_heading = i % 2 == 0;
    fix.fix.covariance = Eigen::Vector3d(0.09, 0.04, 0.01).asDiagonal();
    fix.X_KF = Pose2(0.2, 0.0, 0.01);
    fix.fix.X_WB = X_WK * fix.X_KF * error(0.3);
    fix.residual = MakeFixResidual(fix);
    window.fixes.push_back(std::move(fix));
  }
  return window;
}

/// Ceres's covariances of the same problem, of right perturbations.
std::vector<Eigen::Matrix3d> CeresCovariances(KeyframeWindow& window) {
  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  const AbsolutePoseResidual::CostFunction prior(
      new AbsolutePoseResidual(window.prior->X_WB, Pose2(), window.prior->covariance));
  std::vector<std::pair<const double*, const double*>> blocks;
  for (std::size_t i = 0; i < window.keyframes.size(); ++i) {
    double* x = window.keyframes[i].x_WK.data();
    blocks.emplace_back(x, x);
    if (i == 0) continue;
    problem.AddResidualBlock(
        window.keyframes[i].motion_residual.get(), nullptr, window.keyframes[i - 1].x_WK.data(), x);
  }
  problem.AddResidualBlock(const_cast<AbsolutePoseResidual::CostFunction*>(&prior),
                           nullptr,
                           window.keyframes.front().x_WK.data());
  for (AttachedFix& fix : window.fixes) {
    problem.AddResidualBlock(fix.residual.get(), nullptr, window.Get(fix.keyframe_id).x_WK.data());
  }
  ceres::Covariance covariance{ceres::Covariance::Options()};
  EXPECT_TRUE(covariance.Compute(blocks, &problem));
  std::vector<Eigen::Matrix3d> result;
  for (const Keyframe& keyframe : window.keyframes) {
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> block;
    covariance.GetCovarianceBlock(keyframe.x_WK.data(), keyframe.x_WK.data(), block.data());
    Eigen::Matrix3d R_KW = Eigen::Matrix3d::Identity();
    R_KW.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(-keyframe.x_WK[2]).toRotationMatrix();
    result.emplace_back(R_KW * block * R_KW.transpose());
  }
  return result;
}

TEST(KeyframeWindowTest, CovariancesAgreeWithCeres) {
  KeyframeWindow window = MakeWindow(20, 1);
  ASSERT_TRUE(Solve(window, kQuadratic, 50));
  const std::vector<Eigen::Matrix3d> expected = CeresCovariances(window);
  const std::vector<Eigen::Matrix3d> smoothed = SmoothedCovariances(window, kQuadratic);
  // The motion's residual is not linear: carried to first order it differs in the fourth digit.
  const double tolerance = 0.02 * expected.back().diagonal().maxCoeff();
  EXPECT_THAT(NewestCovariance(window, kQuadratic), IsNear(expected.back(), tolerance));
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_THAT(smoothed[i], IsNear(expected[i], tolerance)) << "keyframe " << i;
  }
}

TEST(KeyframeWindowTest, MarginalizingChangesNeitherEstimateNorCovariance) {
  KeyframeWindow whole = MakeWindow(30, 2);
  KeyframeWindow shortened = MakeWindow(30, 2);
  ASSERT_TRUE(Solve(whole, kQuadratic, 50));
  ASSERT_TRUE(Solve(shortened, kQuadratic, 50));
  for (int i = 0; i < 20; ++i)
    MarginalizeOldest(shortened, kQuadratic);
  EXPECT_EQ(shortened.keyframes.size(), 10U);
  EXPECT_EQ(shortened.fixes.front().keyframe_id, 21);
  ASSERT_TRUE(Solve(shortened, kQuadratic, 50));
  const Pose2 difference =
      whole.keyframes.back().X_WK().Inverse() * shortened.keyframes.back().X_WK();
  EXPECT_LT(difference.Log().norm(), 2e-3);
  EXPECT_THAT(NewestCovariance(shortened, kQuadratic),
              IsNear(NewestCovariance(whole, kQuadratic), 1e-4));
}

/// A stiff chain that is held by weak fixes alone: what a rigid shift costs is small beside what
/// bending costs.
KeyframeWindow MakeStiffWindow() {
  KeyframeWindow window = MakeWindow(200, 3);
  window.prior.reset();
  for (Keyframe& keyframe : window.keyframes) {
    keyframe.covariance_PK = 1e-5 * Eigen::Matrix3d::Identity();
    if (keyframe.motion_residual) keyframe.motion_residual = MakeMotionResidual(keyframe);
  }
  for (AttachedFix& fix : window.fixes) {
    fix.fix.covariance = 49.0 * Eigen::Matrix3d::Identity();
    fix.residual = MakeFixResidual(fix);
  }
  return window;
}

TEST(KeyframeWindowTest, FindsTheMinimumInAFewIterationsFarFromIt) {
  KeyframeWindow window = MakeStiffWindow();
  KeyframeWindow shifted = MakeStiffWindow();
  for (Keyframe& keyframe : shifted.keyframes) {
    keyframe.x_WK[0] += 30.0;
    keyframe.x_WK[1] -= 20.0;
  }
  ASSERT_TRUE(Solve(window, kQuadratic, 100));
  ASSERT_TRUE(Solve(shifted, kQuadratic, 3));
  const Pose2 difference =
      window.keyframes.back().X_WK().Inverse() * shifted.keyframes.back().X_WK();
  EXPECT_LT(difference.translation().norm(), 0.05);
}

TEST(KeyframeWindowTest, FixesOfOnePlaceCountAsOneAtMost) {
  const FixWeighting weighting(1e6, 1.0);
  KeyframeWindow window = MakeWindow(2, 4);
  const Eigen::Matrix3d of_one = NewestCovariance(window, weighting);
  for (int i = 1; i <= 100; ++i) {
    AttachedFix fix;
    fix.keyframe_id = 0;
    fix.fix = window.fixes.front().fix;
    fix.fix.time += std::chrono::seconds(i);
    fix.X_KF = window.fixes.front().X_KF;
    fix.residual = MakeFixResidual(fix);
    window.fixes.push_back(std::move(fix));
  }
  EXPECT_THAT(NewestCovariance(window, weighting), IsNear(of_one, 1e-9));
}

TEST(KeyframeWindowTest, KeepsTheEstimatesWhenTheSolverFails) {
  KeyframeWindow window = MakeWindow(5, 5);
  window.keyframes[2].X_PK = Pose2(std::nan(""), 0.0, 0.0);
  window.keyframes[2].motion_residual = MakeMotionResidual(window.keyframes[2]);
  const std::array<double, 3> before = window.keyframes.back().x_WK;
  EXPECT_FALSE(Solve(window, kQuadratic, 5));
  EXPECT_EQ(window.keyframes.back().x_WK, before);
}

TEST(EstimateMisfitTest, RisesWithErrorsThatLast) {
  const auto misfit_of = [](int fixes_per_error) {
    TestRandom random(6);
    KeyframeWindow window = MakeWindow(300, 6);
    window.fixes.clear();
    Eigen::Vector2d error;
    for (int i = 0; i < 300; ++i) {
      if (i % fixes_per_error == 0) {
        error = {random.Uniform(-1.7, 1.7), random.Uniform(-1.7, 1.7)};  // a sigma of 1
      }
      AttachedFix fix;
      fix.keyframe_id = i;
      fix.fix.time = window.keyframes[static_cast<std::size_t>(i)].time;
      fix.fix.has_heading = false;
      fix.fix.covariance.setIdentity();
      const Eigen::Vector2d p_WK =
          window.keyframes[static_cast<std::size_t>(i)].X_WK().translation() + error;
      fix.fix.X_WB = Pose2(p_WK.x(), p_WK.y(), 0.0);
      window.fixes.push_back(std::move(fix));
    }
    return EstimateMisfit(window, FixWeighting(1.0, 1.0));
  };
  EXPECT_LT(misfit_of(1), 3.0);
  EXPECT_GT(misfit_of(10), 6.0);
}

}  // namespace
}  // namespace relocd
