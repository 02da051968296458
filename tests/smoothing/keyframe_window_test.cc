#include "smoothing/keyframe_window.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smoothing/bent_window.h"
#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

using std::chrono::milliseconds;

double SumOfShares(const KeyframeWindow& window, std::int64_t keyframe_id) {
  double sum = 0.0;
  for (const AttachedFix& fix : window.fixes) {
    if (fix.keyframe_id == keyframe_id) sum += fix.share;
  }
  return sum;
}

std::vector<double> Shares(const KeyframeWindow& window) {
  std::vector<double> shares;
  for (const AttachedFix& fix : window.fixes)
    shares.push_back(fix.share);
  return shares;
}

/// Else the allowance for a bias would make a fix that is sure across the street unsure of it.
TEST(KeyframeWindowTest, ABiasOfOneIsAsLargeInEachDirectionAsTheFixSays) {
  AttachedFix fix;
  fix.fix.X_WB = Pose2(0.0, 0.0, std::numbers::pi / 2.0);
  fix.fix.covariance << 4.0, 0.2, 0.01, 0.2, 0.09, 0.02, 0.01, 0.02, 0.01;
  PrepareResidual(fix);
  Eigen::Matrix3d along_W;  // x is the body's -y, y its x
  along_W << 0.09, -0.2, -0.02, -0.2, 4.0, 0.01, -0.02, 0.01, 0.01;
  EXPECT_THAT(fix.covariance_root * fix.covariance_root.transpose(), IsNear(along_W, 1e-12));

  fix.fix.has_heading = false;
  PrepareResidual(fix);
  Eigen::Matrix3d position = Eigen::Matrix3d::Zero();
  position.topLeftCorner<2, 2>() << 4.0, 0.2, 0.2, 0.09;
  EXPECT_THAT(fix.covariance_root * fix.covariance_root.transpose(), IsNear(position, 1e-12));
}

TEST(KeyframeWindowTest, FixesOfOnePlaceCountAsOneAtMost) {
  KeyframeWindow window = MakeBentWindow(2, 4);
  for (int i = 1; i <= 100; ++i) {
    AttachedFix fix = MakeAttachedFix(window.keyframes.front(), Pose2(), true);
    fix.fix.time += std::chrono::seconds(i);
    window.Insert(fix);
  }
  UpdateAllShares(window, 1.0);
  EXPECT_NEAR(SumOfShares(window, 0), 1.0, 1e-12);
}

TEST(KeyframeWindowTest, FixesCloserThanTheCorrelationTimeShareTheInformationOfOne) {
  KeyframeWindow window = MakeBentWindow(2, 4);
  AttachedFix fix = MakeAttachedFix(window.keyframes.back(), Pose2(), true);
  fix.fix.time = window.fixes.front().fix.time + milliseconds(250);
  window.Insert(fix);
  UpdateAllShares(window, 1.0);
  EXPECT_THAT(Shares(window), ::testing::ElementsAre(1.0, 0.25));
}

TEST(KeyframeWindowTest, AGatedFixHasNoShare) {
  KeyframeWindow window = MakeBentWindow(5, 4);
  window.fixes.back().is_gated = true;
  UpdateAllShares(window, 1.0);
  EXPECT_EQ(window.fixes.back().share, 0.0);
}

/// What is updated about one fix is what all shares would be.
TEST(KeyframeWindowTest, SharesThatAreUpdatedInPartAgreeWithAll) {
  TestRandom random(7);
  KeyframeWindow window = MakeBentWindow(30, 7);
  UpdateAllShares(window, 1.0);
  for (int trial = 0; trial < 500; ++trial) {
    const auto index = static_cast<std::size_t>(random.Uniform(0.0, 29.99));
    AttachedFix fix = MakeAttachedFix(window.keyframes[index], Pose2(), true);
    fix.fix.time += milliseconds(static_cast<int>(random.Uniform(0.0, 999.0)));
    fix.is_gated = random.Uniform(0.0, 1.0) < 0.3;
    window.Insert(fix);
    UpdateShares(window, 1.0, fix.keyframe_id);
    KeyframeWindow all = window;
    UpdateAllShares(all, 1.0);
    ASSERT_EQ(Shares(window), Shares(all)) << trial;
  }
}

TEST(KeyframeWindowTest, PopsAKeyframeWithItsFixesAndKeepsTheLastTime) {
  KeyframeWindow window = MakeBentWindow(10, 1);
  window.PopFront();
  EXPECT_EQ(window.keyframes.front().id, 1);
  EXPECT_EQ(window.fixes.front().keyframe_id, 3);
  EXPECT_EQ(window.last_removed_fix, MonotonicTime(std::chrono::seconds(0)));
  EXPECT_EQ(window.Get(5).id, 5);
}

}  // namespace
}  // namespace relocd
