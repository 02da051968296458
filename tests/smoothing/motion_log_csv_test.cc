#include "smoothing/motion_log_csv.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using testing::HasSubstr;

const std::string kCovarianceColumns = ",cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt";

TEST(MotionLogCsvTest, ReadsOdometryWithItsCovariance) {
  const auto steps = ParseOdometryCsv("time_ns,dx_m,dy_m,dtheta_rad" + kCovarianceColumns +
                                          "\n1000,1,2,3,0.1,0.01,0.02,0.2,0.03,0.3\n",
                                      "odo.csv",
                                      {});
  ASSERT_TRUE(steps) << steps.error().message;
  ASSERT_EQ(steps->size(), 1U);
  EXPECT_EQ(ToNanoseconds(steps->front().time), 1000);
  EXPECT_EQ(steps->front().X_BprevB.y(), 2.0);
  EXPECT_EQ(steps->front().covariance(1, 2), 0.03);
  EXPECT_EQ(steps->front().covariance(2, 0), 0.02);
}

TEST(MotionLogCsvTest, GivesOdometryWithoutCovarianceTheConfigsNoise) {
  const auto steps =
      ParseOdometryCsv("time_ns,dx_m,dy_m,dtheta_rad\n0,0,0,0\n1000000000,1,0,0\n", "odo.csv", {});
  ASSERT_TRUE(steps) << steps.error().message;
  const OdometryNoiseConfig noise;
  const double expected = noise.position_sigma_m_per_sqrt_s * noise.position_sigma_m_per_sqrt_s +
                          noise.forward_sigma_m_per_sqrt_m * noise.forward_sigma_m_per_sqrt_m;
  EXPECT_NEAR(steps->back().covariance(0, 0), expected, 1e-12);
}

TEST(MotionLogCsvTest, AnEmptyHeadingMeansPositionOnly) {
  const auto fixes = ParseFixesCsv("time_ns,x_m,y_m,heading_rad" + kCovarianceColumns +
                                       "\n1,10,20,,4,1,,9,,\n2,10,20,0.5,4,1,0,9,0,0.01\n",
                                   "fixes.csv",
                                   {});
  ASSERT_TRUE(fixes) << fixes.error().message;
  EXPECT_FALSE(fixes->at(0).has_heading);
  EXPECT_EQ(fixes->at(0).covariance(0, 1), 1.0);
  EXPECT_TRUE(fixes->at(1).has_heading);
  EXPECT_EQ(fixes->at(1).covariance(2, 2), 0.01);
}

TEST(MotionLogCsvTest, FixesWithoutCovarianceHaveTheConfigsSigma) {
  SmootherConfig config;
  config.default_fix_sigma_m = 3.0;
  const auto fixes = ParseFixesCsv("time_ns,x_m,y_m\n1,10,20\n", "fixes.csv", config);
  ASSERT_TRUE(fixes) << fixes.error().message;
  EXPECT_FALSE(fixes->front().has_heading);
  EXPECT_EQ(fixes->front().covariance(0, 0), 9.0);
}

struct BadFile {
  std::string name;
  std::string text;
  std::string message;
};

class BadOdometryCsvTest : public testing::TestWithParam<BadFile> {};

TEST_P(BadOdometryCsvTest, IsRefusedWithFileAndLine) {
  const auto steps = ParseOdometryCsv(GetParam().text, "odo.csv", {});
  ASSERT_FALSE(steps);
  EXPECT_EQ(steps.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(steps.error().message, HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Files,
    BadOdometryCsvTest,
    testing::Values(
        BadFile{"Header", "time_ns,dx,dy,dtheta\n", "odo.csv: line 1: the header has no column"},
        BadFile{"Absurd",
                "time_ns,dx_m,dy_m,dtheta_rad\n0,0,0,0\n5,-1e300,0,0\n",
                "odo.csv: line 3: a number is -1e+300, must be within 100000000 m or rad"},
        BadFile{"NotANumber",
                "time_ns,dx_m,dy_m,dtheta_rad\n1,0,zero,0\n",
                "odo.csv: line 2: dy_m is 'zero', must be a finite number"},
        BadFile{"NotFinite",
                "time_ns,dx_m,dy_m,dtheta_rad\n1,nan,0,0\n",
                "odo.csv: line 2: dx_m is 'nan', must be a finite number"},
        BadFile{"TimeStands",
                "time_ns,dx_m,dy_m,dtheta_rad\n5,0,0,0\n5,0,0,0\n",
                "odo.csv: line 3: time_ns is 5, must be above the row before's 5"},
        BadFile{"NoCovariance",
                "time_ns,dx_m,dy_m,dtheta_rad" + kCovarianceColumns + "\n1,0,0,0,-1,0,0,1,0,1\n",
                "odo.csv: line 2: cov_xx,...,cov_tt is -1,0,0,1,0,1, must be positive definite"}),
    [](const auto& instance) { return instance.param.name; });

TEST(MotionLogCsvTest, LeavesTheCellsOfAnUnknownPoseEmpty) {
  SmootherEstimate known;
  known.time = FromNanoseconds(7);
  known.has_pose = true;
  known.status = SmootherStatus::kOk;
  known.X_WB = Pose2(1.5, -2.0, 0.25);
  known.covariance = Eigen::Matrix3d::Identity();
  EXPECT_EQ(FormatEstimatesCsv({SmootherEstimate(), known}),
            "time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,status\n"
            "0,,,,,,,,,,uninitialised\n"
            "7,1.500000,-2.000000,0.25000000,1,0,0,1,0,1,ok\n");
}

}  // namespace
}  // namespace relocd
