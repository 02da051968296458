#include "geometry/trajectory_metrics.h"

#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/planar.h"
#include "support/eigen_matchers.h"
#include "support/random.h"
#include "support/shared_data.h"

namespace relocd {
namespace {

constexpr double kTolerance = 1e-9;
constexpr double kRadPerDeg = std::numbers::pi / 180.0;

TEST(ErrorSummaryTest, AgreesWithACalculationByHead) {
  const ErrorSummary summary = Summarize({4.0, 1.0, 3.0, 2.0});
  EXPECT_EQ(summary.count, 4U);
  EXPECT_DOUBLE_EQ(summary.mean, 2.5);
  EXPECT_DOUBLE_EQ(summary.rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(summary.median, 2.5);
  EXPECT_DOUBLE_EQ(summary.p95, 4.0);
  EXPECT_DOUBLE_EQ(summary.max, 4.0);
}

TEST(ErrorSummaryTest, P95LeavesOneInTwentyOut) {
  std::vector<double> errors;
  for (int i = 1; i <= 100; ++i)
    errors.push_back(i);
  EXPECT_DOUBLE_EQ(Summarize(errors).p95, 95.0);
  EXPECT_DOUBLE_EQ(Summarize(errors).median, 50.5);
  EXPECT_DOUBLE_EQ(Summarize({7.0}).p95, 7.0);
  EXPECT_EQ(Summarize({}).count, 0U);
}

/// A drive at 2 m/s with a bend, ten poses a second.
std::vector<PosePair> MakeDrive(int count) {
  std::vector<PosePair> pairs;
  Pose2 X_WB;
  for (int i = 0; i < count; ++i) {
    pairs.push_back({.time_ns = i * 100'000'000LL,
                     .X_WB_true = LiftFromPlane(X_WB),
                     .X_WB = LiftFromPlane(X_WB)});
    X_WB = X_WB * Pose2::Exp({0.2, 0.0, i > count / 2 ? 0.05 : 0.0});
  }
  return pairs;
}

TEST(TrajectoryMetricsTest, AConstantOffsetIsTheError) {
  auto pairs = MakeDrive(50);
  for (PosePair& pair : pairs)
    pair.X_WB = LiftFromPlane(Pose2(3.0, 4.0, 0.0)) * pair.X_WB;
  EXPECT_NEAR(Summarize(PositionErrors(pairs)).mean, 5.0, kTolerance);
  EXPECT_NEAR(Summarize(PositionErrors(pairs)).max, 5.0, kTolerance);
  EXPECT_NEAR(Summarize(RotationErrors(pairs)).max, 0.0, kTolerance);
}

TEST(TrajectoryMetricsTest, AlignmentTakesARigidMoveAway) {
  TestRandom random(1);
  for (int trial = 0; trial < 50; ++trial) {
    auto pairs = MakeDrive(80);
    const Pose3 move = LiftFromPlane(random.Pose());
    for (PosePair& pair : pairs)
      pair.X_WB = move * pair.X_WB;
    const auto alignment = AlignToTruth(pairs, true);
    ASSERT_TRUE(alignment);
    for (PosePair& pair : pairs)
      pair.X_WB = *alignment * pair.X_WB;
    EXPECT_NEAR(Summarize(PositionErrors(pairs)).max, 0.0, kTolerance);
    EXPECT_NEAR(Summarize(RotationErrors(pairs)).max, 0.0, 1e-7);
  }
}

TEST(TrajectoryMetricsTest, RelativeErrorsDoNotSeeARigidMove) {
  auto pairs = MakeDrive(200);
  for (PosePair& pair : pairs)
    pair.X_WB = LiftFromPlane(Pose2(100.0, -50.0, 2.0)) * pair.X_WB;
  for (const RelativeError& error : RelativeErrorsOverDistance(pairs, 5.0)) {
    EXPECT_NEAR(error.translation_m, 0.0, kTolerance);
    EXPECT_NEAR(error.rotation_rad, 0.0, 1e-7);
  }
}

TEST(TrajectoryMetricsTest, AWheelThatMeasuresTwoPercentTooMuchIsFound) {
  std::vector<PosePair> pairs;
  for (int i = 0; i < 300; ++i) {
    pairs.push_back({.time_ns = i * 100'000'000LL,
                     .X_WB_true = LiftFromPlane(Pose2(0.2 * i, 0.0, 0.0)),
                     .X_WB = LiftFromPlane(Pose2(0.2 * 1.02 * i, 0.0, 0.0))});
  }
  const auto errors = RelativeErrorsOverDistance(pairs, 10.0);
  EXPECT_EQ(errors.size(), 250U);  // each pair with one 50 later
  for (const RelativeError& error : errors) {
    EXPECT_NEAR(error.travelled_m, 10.0, 0.2 + kTolerance);
    EXPECT_NEAR(error.translation_m / error.travelled_m, 0.02, kTolerance);
  }
  const auto timed = RelativeErrorsOverTime(pairs, 1'000'000'000);
  EXPECT_EQ(timed.size(), 290U);
  EXPECT_NEAR(timed.front().translation_m, 0.04, kTolerance);
  EXPECT_NEAR(timed.front().duration_s, 1.0, kTolerance);
}

TEST(TrajectoryMetricsTest, AWayThatIsTooShortHasNoRelativeErrors) {
  EXPECT_TRUE(RelativeErrorsOverDistance(MakeDrive(10), 100.0).empty());
  EXPECT_TRUE(RelativeErrorsOverTime(MakeDrive(10), 60'000'000'000).empty());
  EXPECT_TRUE(RelativeErrorsOverDistance({}, 1.0).empty());
}

TEST(CoverageTest, HonestCovariancesAreFoundHonest) {
  TestRandom random(2);
  CoverageCounter counter;
  CoverageCounter boastful;
  for (int i = 0; i < 20'000; ++i) {
    Eigen::Matrix3d root = Eigen::Matrix3d::Zero();
    root.diagonal() << random.Uniform(0.1, 1.0), random.Uniform(0.1, 1.0),
        random.Uniform(0.01, 0.1);
    root(1, 0) = random.Uniform(-0.5, 0.5);
    root(2, 1) = random.Uniform(-0.05, 0.05);
    const Eigen::Matrix3d covariance = root * root.transpose();
    const Eigen::Vector3d error =
        root * Eigen::Vector3d(random.Normal(1.0), random.Normal(1.0), random.Normal(1.0));
    counter.Add(error, covariance);
    boastful.Add(error, 0.25 * covariance);
  }
  const Coverage coverage = counter.Total();
  EXPECT_EQ(coverage.position_count, 20'000U);
  EXPECT_EQ(coverage.pose_count, 20'000U);
  EXPECT_NEAR(coverage.position_share, 0.95, 0.005);  // 3 sigma of 20,000 draws
  EXPECT_NEAR(coverage.pose_share, 0.95, 0.005);
  EXPECT_NEAR(coverage.position_nees, 2.0, 0.06);
  EXPECT_NEAR(coverage.pose_nees, 3.0, 0.06);
  EXPECT_LT(boastful.Total().position_share, 0.8);
  EXPECT_NEAR(boastful.Total().pose_nees, 12.0, 0.3);
}

TEST(CoverageTest, AnEstimateWithoutAHeadingCountsForThePositionOnly) {
  CoverageCounter counter;
  counter.AddPosition({1.0, 2.0}, Eigen::Matrix2d::Identity());
  EXPECT_EQ(counter.Total().position_count, 1U);
  EXPECT_EQ(counter.Total().pose_count, 0U);
  EXPECT_DOUBLE_EQ(counter.Total().position_nees, 5.0);
  EXPECT_DOUBLE_EQ(counter.Total().position_share, 1.0);  // 5 < 5.99
}

TEST(CoverageTest, NothingReportedIsNothingCounted) {
  EXPECT_EQ(CoverageCounter().Total().position_count, 0U);
}

/// Lines `image qw qx qy qz tx ty tz ...` with the world in the camera, by image.
std::map<std::string, Pose3> ReadWorldInCamera(const std::string& path) {
  std::map<std::string, Pose3> poses;
  std::ifstream file(path);
  EXPECT_TRUE(file) << path;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string image;
    Eigen::Quaterniond q;
    Eigen::Vector3d t;
    words >> image >> q.w() >> q.x() >> q.y() >> q.z() >> t.x() >> t.y() >> t.z();
    EXPECT_TRUE(words) << path << ": " << line;
    poses[image] = Pose3(q, t);
  }
  return poses;
}

struct PublishedMedians {
  std::string scene;
  std::string truth;
  double position_cm;
  double rotation_deg;
};

class SevenScenesTest : public testing::TestWithParam<PublishedMedians> {};

/// The medians that the data set's own authors give for DSAC* from RGB, which was trained on this
/// pseudo ground truth.
TEST_P(SevenScenesTest, MediansAgreeWithThePublishedOnes) {
  const std::string folder = SharedData("sevenscenes_predictions");
  if (folder.empty()) GTEST_SKIP() << SharedDataReason("sevenscenes_predictions");
  const auto truths =
      ReadWorldInCamera(folder + "/pgt/" + GetParam().scene + "_" + GetParam().truth + ".txt");
  const auto estimates =
      ReadWorldInCamera(folder + "/estimates/" + GetParam().scene + "_dsac_rgb.txt");
  std::vector<PosePair> pairs;
  for (const auto& [image, X_CW] : estimates) {
    const auto truth = truths.find(image);
    if (truth == truths.end()) continue;
    pairs.push_back({.X_WB_true = truth->second.Inverse(), .X_WB = X_CW.Inverse()});
  }
  ASSERT_GT(pairs.size(), 900U);
  EXPECT_NEAR(Summarize(PositionErrors(pairs)).median * 100.0, GetParam().position_cm, 0.006);
  EXPECT_NEAR(Summarize(RotationErrors(pairs)).median / kRadPerDeg, GetParam().rotation_deg, 0.006);
}

INSTANTIATE_TEST_SUITE_P(All,
                         SevenScenesTest,
                         testing::Values(PublishedMedians{"chess", "dslam", 1.83, 0.59},
                                         PublishedMedians{"heads", "dslam", 1.04, 0.66},
                                         PublishedMedians{"stairs", "dslam", 3.52, 0.93}),
                         [](const auto& instance) {
                           return instance.param.scene + instance.param.truth;
                         });

}  // namespace
}  // namespace relocd
