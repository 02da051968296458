#include "geometry/alignment.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

constexpr int kTrials = 200;
constexpr double kTolerance = 1e-9;

TEST(AlignPointsTest, FindsThePlanarTransformExactly) {
  TestRandom random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_AB = random.Pose();
    std::vector<Eigen::Vector2d> p_APs;
    std::vector<Eigen::Vector2d> p_BPs;
    for (int i = 0; i < 2 + trial % 5; ++i) {
      p_BPs.push_back(random.Point());
      p_APs.emplace_back(X_AB * p_BPs.back());
    }
    const auto aligned = AlignPoints(p_APs, p_BPs);
    ASSERT_TRUE(aligned) << aligned.error().message;
    EXPECT_THAT((aligned->Inverse() * X_AB).Log(), IsNear(Eigen::Vector3d::Zero(), kTolerance));
  }
}

TEST(AlignPointsTest, FindsTheSpatialTransformExactly) {
  TestRandom random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose3 X_AB = random.SpatialPose();
    std::vector<Eigen::Vector3d> p_APs;
    std::vector<Eigen::Vector3d> p_BPs;
    for (int i = 0; i < 3 + trial % 5; ++i) {  // three points lie in a plane
      p_BPs.push_back(random.Point3());
      p_APs.emplace_back(X_AB * p_BPs.back());
    }
    const auto aligned = AlignPoints(p_APs, p_BPs);
    ASSERT_TRUE(aligned) << aligned.error().message;
    EXPECT_THAT((aligned->Inverse() * X_AB).Log(), IsNear(Vector6d(Vector6d::Zero()), 1e-7));
  }
}

TEST(AlignPointsTest, NoSmallMoveBringsNoisyPointsCloser) {
  TestRandom random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Pose2 X_AB = random.Pose();
    std::vector<Eigen::Vector2d> p_APs;
    std::vector<Eigen::Vector2d> p_BPs;
    for (int i = 0; i < 20; ++i) {
      p_BPs.push_back(random.Point());
      p_APs.emplace_back(X_AB * p_BPs.back() +
                         Eigen::Vector2d(random.Normal(0.5), random.Normal(0.5)));
    }
    const auto cost = [&](const Pose2& pose) {
      double sum = 0.0;
      for (std::size_t i = 0; i < p_APs.size(); ++i)
        sum += (p_APs[i] - pose * p_BPs[i]).squaredNorm();
      return sum;
    };
    const auto aligned = AlignPoints(p_APs, p_BPs);
    ASSERT_TRUE(aligned);
    for (int i = 0; i < 3; ++i) {
      for (const double step : {-1e-3, 1e-3}) {
        Eigen::Vector3d move = Eigen::Vector3d::Zero();
        move[i] = step;
        EXPECT_GT(cost(*aligned * Pose2::Exp(move)), cost(*aligned));
      }
    }
  }
}

TEST(AlignPointsTest, AMirroredCloudIsStillTurnedNotMirrored) {
  TestRandom random(4);
  std::vector<Eigen::Vector3d> p_APs;
  std::vector<Eigen::Vector3d> p_BPs;
  for (int i = 0; i < 10; ++i) {
    p_BPs.push_back(random.Point3());
    p_APs.emplace_back(-p_BPs.back().x(), p_BPs.back().y(), p_BPs.back().z());
  }
  const auto aligned = AlignPoints(p_APs, p_BPs);
  ASSERT_TRUE(aligned);
  EXPECT_NEAR(aligned->R().determinant(), 1.0, kTolerance);
}

TEST(AlignPointsTest, SaysWhyThereIsNone) {
  const std::vector<Eigen::Vector2d> one{{1, 2}};
  EXPECT_EQ(AlignPoints(one, one).error().message,
            "aligning: has 1 and 1 points, must have as many, and at least 2");
  const std::vector<Eigen::Vector2d> same{{1, 2}, {1, 2}, {1, 2}};
  EXPECT_EQ(AlignPoints(same, same).error().message,
            "aligning: the points are all in one place, must be in at least two");
  const std::vector<Eigen::Vector3d> line{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
  EXPECT_EQ(AlignPoints(line, line).error().message,
            "aligning: the points are all on one line, which leaves the turn about it open");
}

}  // namespace
}  // namespace relocd
