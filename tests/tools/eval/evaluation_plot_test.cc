#include "evaluation_plot.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "geometry/planar.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

EvaluatedTrajectory MakeDrive(int count, bool with_covariance) {
  EvaluatedTrajectory drive{
      .path = "drive", .planar = true, .rows = 0, .poses = {}, .rows_without_pose = {}};
  for (int i = 0; i < count; ++i) {
    EvaluatedPose pose{.time_ns = i * 100'000'000LL,
                       .X_WB = LiftFromPlane(Pose2(0.5 * i, 0.1 * i, 0.2)),
                       .has_heading = true,
                       .covariance = std::nullopt};
    if (with_covariance) pose.covariance = 0.04 * Eigen::Matrix3d::Identity();
    drive.poses.push_back(pose);
  }
  drive.rows = drive.poses.size();
  return drive;
}

/// How many pixels are not white.
int InkOf(const std::string& path) {
  const cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE);
  EXPECT_FALSE(image.empty());
  return static_cast<int>(image.total()) - cv::countNonZero(image == 255);
}

TEST(EvaluationPlotTest, DrawsAPngWithMoreInkForMoreToShow) {
  const TemporaryFolder folder;
  const auto truth = MakeDrive(100, false);
  const auto bare = Evaluate(truth, truth, {});
  const auto with_covariance = Evaluate(truth, MakeDrive(100, true), {});
  ASSERT_TRUE(bare);
  ASSERT_TRUE(with_covariance);
  ASSERT_TRUE(WritePlot(*bare, "bare", folder.path() + "/bare.png"));
  ASSERT_TRUE(WritePlot(*with_covariance, "bare", folder.path() + "/covariance.png"));
  EXPECT_GT(InkOf(folder.path() + "/bare.png"), 10'000);
  EXPECT_GT(InkOf(folder.path() + "/covariance.png"), InkOf(folder.path() + "/bare.png") + 10'000);
}

TEST(EvaluationPlotTest, OnePoseAndARobotThatStandsCanBeDrawn) {
  const TemporaryFolder folder;
  for (const int count : {1, 5}) {
    auto standing = MakeDrive(count, true);
    for (EvaluatedPose& pose : standing.poses)
      pose.X_WB = Pose3();
    const auto evaluation = Evaluate(standing, standing, {});
    ASSERT_TRUE(evaluation);
    const auto done = WritePlot(*evaluation, "standing", folder.path() + "/standing.png");
    EXPECT_TRUE(done) << done.error().message;
  }
}

TEST(EvaluationPlotTest, SaysWhereItCannotWrite) {
  const auto truth = MakeDrive(10, false);
  const auto evaluation = Evaluate(truth, truth, {});
  ASSERT_TRUE(evaluation);
  const auto done = WritePlot(*evaluation, "", "/nonexistent/plot.png");
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().kind, ErrorKind::kUnavailable);
  EXPECT_EQ(done.error().message, "writing /nonexistent/plot.png: failed");
  EXPECT_THAT(WritePlot(*evaluation, "", "/tmp/plot.unknown").error().message,
              testing::HasSubstr("writing /tmp/plot.unknown: "));
}

}  // namespace
}  // namespace relocd
