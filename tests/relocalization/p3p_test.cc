#include "relocalization/p3p.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "relocalization/test_scene.h"
#include "support/eigen_matchers.h"

namespace relocd {
namespace {

constexpr int kTrials = 10000;

double Distance(const CameraFromWorld& a, const CameraFromWorld& b) {
  return std::max((a.R_CW - b.R_CW).cwiseAbs().maxCoeff(), (a.p_CW - b.p_CW).cwiseAbs().maxCoeff());
}

struct Triplet {
  Eigen::Matrix3d rays_C;
  Eigen::Matrix3d p_WPs;
  CameraFromWorld truth;
};

/// Three points that a camera sees within 45 degrees of its axis, 1 to 30 m away.
Triplet DrawTriplet(SceneRandom& random) {
  const Pose3 X_CW = random.Pose().Inverse();
  Triplet triplet;
  triplet.truth = {.R_CW = X_CW.R(), .p_CW = X_CW.translation()};
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double depth = random.Uniform(1.0, 30.0);
    const Eigen::Vector3d p_CP(
        depth * random.Uniform(-0.7, 0.7), depth * random.Uniform(-0.7, 0.7), depth);
    triplet.rays_C.col(i) = p_CP.normalized();
    triplet.p_WPs.col(i) = X_CW.Inverse() * p_CP;
  }
  return triplet;
}

TEST(P3pTest, FindsTheTruePoseInEveryDraw) {
  SceneRandom random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Triplet triplet = DrawTriplet(random);
    double nearest = std::numeric_limits<double>::infinity();
    for (const CameraFromWorld& solution : SolveP3p(triplet.rays_C, triplet.p_WPs)) {
      nearest = std::min(nearest, Distance(solution, triplet.truth));
    }
    EXPECT_LT(nearest, 1e-6) << "trial " << trial;
  }
}

TEST(P3pTest, EverySolutionIsARotationThatExplainsThePoints) {
  SceneRandom random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Triplet triplet = DrawTriplet(random);
    for (const CameraFromWorld& solution : SolveP3p(triplet.rays_C, triplet.p_WPs)) {
      EXPECT_THAT(solution.R_CW * solution.R_CW.transpose(),
                  IsNear(Eigen::Matrix3d::Identity(), 1e-12));
      EXPECT_GT(solution.R_CW.determinant(), 0.0);
      for (Eigen::Index i = 0; i < 3; ++i) {
        const Eigen::Vector3d p_CP = solution * triplet.p_WPs.col(i);
        EXPECT_THAT(p_CP.normalized(), IsNear(triplet.rays_C.col(i), 1e-6)) << "trial " << trial;
      }
    }
  }
}

TEST(P3pTest, FindsAllFourPosesOverAnEquilateralTriangle) {
  // Fischler and Bolles (1981): from straight above, three more views make the same angles.
  Eigen::Matrix3d p_WPs;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / 3.0;
    p_WPs.col(i) << std::cos(angle), std::sin(angle), 2.0;
  }
  const Eigen::Matrix3d rays_C = p_WPs.colwise().normalized();
  const P3pSolutions solutions = SolveP3p(rays_C, p_WPs);
  EXPECT_EQ(solutions.size(), 4U);
  double nearest = std::numeric_limits<double>::infinity();
  for (const CameraFromWorld& solution : solutions) {
    nearest = std::min(nearest, Distance(solution, CameraFromWorld{}));
  }
  EXPECT_LT(nearest, 1e-9);
}

TEST(P3pTest, CallsPointsOnALineDegenerate) {
  Eigen::Matrix3d p_WPs;
  p_WPs << 0.0, 1.0, 2.0,  //
      0.0, 1.0, 2.0,       //
      5.0, 6.0, 7.0;
  const P3pSolutions solutions = SolveP3p(p_WPs.colwise().normalized(), p_WPs);
  EXPECT_EQ(solutions.size(), 0U);
  EXPECT_TRUE(solutions.degenerate);
}

TEST(P3pTest, CallsOnePointSeenThriceDegenerate) {
  const Eigen::Matrix3d p_WPs = Eigen::Vector3d(1.0, 2.0, 3.0).replicate<1, 3>();
  const P3pSolutions solutions = SolveP3p(p_WPs.colwise().normalized(), p_WPs);
  EXPECT_EQ(solutions.size(), 0U);
  EXPECT_TRUE(solutions.degenerate);
}

TEST(P3pTest, CallsOneRayForDifferentPointsDegenerate) {
  const Eigen::Matrix3d rays_C = Eigen::Vector3d::UnitZ().replicate<1, 3>();
  const P3pSolutions solutions = SolveP3p(rays_C, Eigen::Matrix3d::Identity());
  EXPECT_EQ(solutions.size(), 0U);
  EXPECT_TRUE(solutions.degenerate);
}

TEST(P3pTest, CallsWhatIsNotFiniteDegenerate) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (Eigen::Index i = 0; i < 9; ++i) {
      Eigen::Matrix3d p_WPs = Eigen::Matrix3d::Identity();
      p_WPs.data()[i] = bad;
      Eigen::Matrix3d rays_C = Eigen::Matrix3d::Identity();
      rays_C.data()[i] = bad;
      EXPECT_TRUE(SolveP3p(Eigen::Matrix3d::Identity(), p_WPs).degenerate);
      EXPECT_TRUE(SolveP3p(rays_C, Eigen::Matrix3d::Identity()).degenerate);
    }
  }
}

}  // namespace
}  // namespace relocd
