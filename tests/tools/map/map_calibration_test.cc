#include "map_calibration.h"

#include <numbers>
#include <vector>

#include <gtest/gtest.h>

namespace relocd {
namespace {

TEST(ConfidenceThresholdTest, IsHalfOfWhatRightPosesHaveWhereWrongOnesComeNear) {
  EXPECT_DOUBLE_EQ(ConfidenceThreshold({0.5, 0.4}, {0.02, 0.15}), 0.2);
}

TEST(ConfidenceThresholdTest, IsNoMoreThanThreeTimesWhatWrongPosesReach) {
  EXPECT_DOUBLE_EQ(ConfidenceThreshold({0.9, 0.8}, {0.06, 0.1}), 3.0 * 0.1);
}

TEST(ConfidenceThresholdTest, IsAboveTheWrongPosesWhereRightOnesAreHardlyBetter) {
  EXPECT_DOUBLE_EQ(ConfidenceThreshold({0.25, 0.3}, {0.2}), 1.1 * 0.2);
}

TEST(ConfidenceThresholdTest, RefusesHardlyARightPose) {
  EXPECT_DOUBLE_EQ(ConfidenceThreshold({0.25, 0.3}, {0.4}), 0.25);
}

TEST(ConfidenceThresholdTest, IsThereWithoutPoses) {
  EXPECT_GT(ConfidenceThreshold({}, {}), 0.0);
}

TEST(FramesBeyondReachTest, AreThoseFarFromAllTrainingPosesOfTheRegionWhereverTheyLook) {
  SceneMap map;
  map.R_WD = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ());
  map.regions.resize(2);
  // Of the first region the camera looks along x from 0 to 100 m; the other one is elsewhere.
  for (const float x : {0.0F, 50.0F, 100.0F})
    map.regions[0].training_poses.push_back({{x, 0.0F, 1.0F}, 0.0F});
  map.regions[1].training_poses.push_back({{0.0F, 200.0F, 1.0F}, 0.0F});
  const Eigen::Quaterniond back(
      Eigen::AngleAxisd(-0.5 * std::numbers::pi, Eigen::Vector3d::UnitY()));
  std::vector<DatasetFrame> frames;
  for (const double x : {20.0, 149.0, 151.0}) {
    DatasetFrame frame;
    frame.index = static_cast<int>(x);
    frame.X_WC = Pose3(map.R_WD, Eigen::Vector3d::Zero()).Inverse() *
                 Pose3(back, Eigen::Vector3d(x, 0.0, 1.0));
    frames.push_back(frame);
  }
  const std::vector<DatasetFrame> beyond = FramesBeyondReach(map, 0, frames);
  ASSERT_EQ(beyond.size(), 1U);
  EXPECT_EQ(beyond[0].index, 151);
}

}  // namespace
}  // namespace relocd
