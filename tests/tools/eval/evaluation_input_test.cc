#include "evaluation_input.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/planar.h"
#include "support/eigen_matchers.h"

namespace relocd {
namespace {

using testing::ElementsAre;
using testing::Pair;

TEST(EvaluationInputTest, ReadsTum) {
  const auto trajectory =
      ParseEvaluatedTrajectory("# time_s ...\n1.5 1 2 3 0 0 0 1\n2.5 4 5 6 0 0 1 0\n", "t.txt");
  ASSERT_TRUE(trajectory) << trajectory.error().message;
  EXPECT_FALSE(trajectory->planar);
  ASSERT_EQ(trajectory->poses.size(), 2U);
  EXPECT_EQ(trajectory->poses[1].time_ns, 2'500'000'000);
  EXPECT_THAT(trajectory->poses[1].X_WB.translation(), IsNear(Eigen::Vector3d(4, 5, 6), 0.0));
  EXPECT_TRUE(trajectory->poses[1].has_heading);
}

TEST(EvaluationInputTest, ReadsAnEstimateWithItsCovariance) {
  const auto trajectory = ParseEvaluatedTrajectory(
      "time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,status\n"
      "100,1,2,0.5,4,1,0.1,5,0.2,0.3,ok\n"
      "200,1,2,0.5,,,,,,,uninitialised\n",
      "est.csv");
  ASSERT_TRUE(trajectory) << trajectory.error().message;
  EXPECT_TRUE(trajectory->planar);
  ASSERT_EQ(trajectory->poses.size(), 2U);
  EXPECT_NEAR(ProjectToPlane(trajectory->poses[0].X_WB).yaw(), 0.5, 1e-12);
  Eigen::Matrix3d covariance;
  covariance << 4, 1, 0.1, 1, 5, 0.2, 0.1, 0.2, 0.3;
  ASSERT_TRUE(trajectory->poses[0].covariance);
  EXPECT_THAT(*trajectory->poses[0].covariance, IsNear(covariance, 0.0));
  EXPECT_FALSE(trajectory->poses[1].covariance);
}

TEST(EvaluationInputTest, ReadsPositionsWithoutHeading) {
  const auto trajectory = ParseEvaluatedTrajectory(
      "time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt\n"
      "100,1,2,,4,1,,5,,\n",
      "fixes.csv");
  ASSERT_TRUE(trajectory) << trajectory.error().message;
  EXPECT_FALSE(trajectory->poses[0].has_heading);
  ASSERT_TRUE(trajectory->poses[0].covariance);
  EXPECT_EQ((*trajectory->poses[0].covariance)(1, 1), 5.0);
  const auto bare = ParseEvaluatedTrajectory("time_ns,x_m,y_m\n100,1,2\n", "fixes.csv");
  ASSERT_TRUE(bare);
  EXPECT_FALSE(bare->poses[0].has_heading);
}

TEST(EvaluationInputTest, ReadsAPlanarTruth) {
  const auto trajectory =
      ParseEvaluatedTrajectory("t_s,x_m,y_m,theta_rad\n0.103736,1,2,-3\n", "planar_truth.csv");
  ASSERT_TRUE(trajectory) << trajectory.error().message;
  EXPECT_EQ(trajectory->poses[0].time_ns, 103'736'000);
  EXPECT_NEAR(ProjectToPlane(trajectory->poses[0].X_WB).yaw(), -3.0, 1e-12);
}

TEST(EvaluationInputTest, CountsRowsWithoutAPoseByTheirStatus) {
  const auto trajectory = ParseEvaluatedTrajectory(
      "index,time_s,status,tx_m,ty_m,tz_m,qw,qx,qy,qz,inliers,confidence,sigma_t_m,sigma_r_rad,"
      "region\n"
      "2,0.2,ok,1,2,3,1,0,0,0,500,0.9,0.1,0.01,0\n"
      "7,0.7,too_few_inliers,,,,,,,,12,,,,0\n"
      "12,1.2,too_few_inliers,,,,,,,,14,,,,0\n"
      "17,1.7,undecodable,,,,,,,,,,,,\n",
      "poses.csv");
  ASSERT_TRUE(trajectory) << trajectory.error().message;
  EXPECT_FALSE(trajectory->planar);
  EXPECT_EQ(trajectory->rows, 4U);
  EXPECT_EQ(trajectory->poses.size(), 1U);
  EXPECT_THAT(trajectory->rows_without_pose,
              ElementsAre(Pair("too_few_inliers", 2), Pair("undecodable", 1)));
}

TEST(EvaluationInputTest, TakesTheRowsThatAreAskedFor) {
  const std::string text = "time_ns,x_m,y_m\n1,10,0\n2,11,0\n3,12,0\n4,13,0\n";
  const auto trajectory = ParseEvaluatedTrajectory(text, "est.csv", "1:3");
  ASSERT_TRUE(trajectory);
  EXPECT_EQ(trajectory->rows, 2U);
  EXPECT_EQ(trajectory->poses.front().time_ns, 2);
  EXPECT_EQ(trajectory->poses.back().time_ns, 3);
}

struct BadInput {
  std::string name;
  std::string text;
  std::string message;
  std::string rows = {};
};

class EvaluationInputErrorTest : public testing::TestWithParam<BadInput> {};

TEST_P(EvaluationInputErrorTest, NamesFileAndLine) {
  const auto trajectory = ParseEvaluatedTrajectory(GetParam().text, "f", GetParam().rows);
  ASSERT_FALSE(trajectory);
  EXPECT_EQ(trajectory.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(trajectory.error().message, GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    All,
    EvaluationInputErrorTest,
    testing::Values(
        BadInput{"NotANumber",
                 "time_ns,x_m,y_m\n1,0,0\n2,nan,0\n",
                 "f: line 3: x_m is 'nan', must be a finite number"},
        BadInput{"Infinite",
                 "time_ns,x_m,y_m,heading_rad\n1,0,0,inf\n",
                 "f: line 2: heading_rad is 'inf', must be a finite number"},
        BadInput{"TimesThatDoNotIncrease",
                 "time_ns,x_m,y_m\n# a comment\n5,0,0\n5,1,0\n",
                 "f: line 4: the time is 5 ns, must be above the row before's 5 ns"},
        BadInput{"TumTimesThatDoNotIncrease",
                 "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n",
                 "f: line 2: the time is 1 s, must be above the line before's 2 s"},
        BadInput{"TumNan",
                 "2 0 nan 0 0 0 0 1\n",
                 "f: line 1: is '2 0 nan 0 0 0 0 1', must be 'time_s tx ty tz qx qy qz qw'"},
        BadInput{"Header",
                 "time_ns,east_m,north_m\n1,0,0\n",
                 "f: line 1: the header has no time or no position, must be as "
                 "'time_ns,x_m,y_m[,heading_rad[,cov_xx,...,cov_tt]]', "
                 "'time_s,tx_m,ty_m,tz_m,qw,qx,qy,qz', or the file in TUM format"},
        BadInput{"HalfACovariance",
                 "time_ns,x_m,y_m,heading_rad,cov_xx\n1,0,0,0,1\n",
                 "f: line 1: the header has no column 'cov_xy', it has "
                 "time_ns,x_m,y_m,heading_rad,cov_xx"},
        BadInput{"NoCovariance",
                 "time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt\n"
                 "1,0,0,0,1,2,0,1,0,1\n",
                 "f: line 2: cov_xx,...,cov_tt is 1,2,0,1,0,1, must be symmetric and positive "
                 "definite"},
        BadInput{"NoQuaternion",
                 "time_s,tx_m,ty_m,tz_m,qw,qx,qy,qz\n1,0,0,0,0,0,0,0\n",
                 "f: line 2: the quaternion's length is 0, must not be zero"},
        BadInput{"Empty", "", "f: has no rows, must have at least one"},
        BadInput{"OnlyAHeader", "time_ns,x_m,y_m\n", "f: has no rows, must have at least one"},
        BadInput{"Rows",
                 "time_ns,x_m,y_m\n1,0,0\n",
                 "f: rows: the range is '3:5', must be 'A:B' with 0 <= A < B and A < 1",
                 "3:5"}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace relocd
