#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/csv.h"
#include "geometry/covariance.h"
#include "smoothing/offline_smoother.h"
#include "support/error_statistics.h"
#include "support/slow_build.h"

namespace relocd {
namespace {

/// The released run of the GODSAC* authors on NCLT: positions only, no heading, no outside hint.
struct NcltRun {
  MotionLog log;
  std::vector<Eigen::Vector2d> truth;
  std::vector<Eigen::Vector2d> released;  ///< Their optimised positions.
};

const std::string kFolder = std::string(RELOCD_SOURCE_DIR) + "/../shared/data/nclt_godsac/";

double At(const CsvTable& table, std::size_t row, const char* column) {
  return table.Double(row, table.FindColumn(column).value()).value();
}

MonotonicTime TimeAt(const CsvTable& table, std::size_t row) {
  const auto column = table.FindColumn("timestamp_us").value();
  return FromNanoseconds(table.Int64(row, column).value() * 1000);
}

NcltRun ReadRun(const SmootherConfig& config) {
  NcltRun run;
  const CsvTable frames = CsvTable::Read(kFolder + "frames.csv").value();
  for (std::size_t row = 0; row < frames.row_count(); ++row) {
    run.log.fixes.push_back(MakePositionFix(
        TimeAt(frames, row), {At(frames, row, "pred_x"), At(frames, row, "pred_y")}, config));
    run.truth.emplace_back(At(frames, row, "gt_x"), At(frames, row, "gt_y"));
    run.released.emplace_back(At(frames, row, "gtsam_x"), At(frames, row, "gtsam_y"));
  }
  const CsvTable odometry = CsvTable::Read(kFolder + "odometry_5hz.csv").value();
  const MonotonicTime end = run.log.fixes.back().time;
  for (std::size_t row = 0; row < odometry.row_count() && TimeAt(odometry, row) <= end; ++row) {
    const Pose2 motion(
        At(odometry, row, "dx"), At(odometry, row, "dy"), At(odometry, row, "dtheta"));
    const Duration duration =
        row == 0 ? Duration(0) : TimeAt(odometry, row) - TimeAt(odometry, row - 1);
    run.log.odometry.push_back(
        MakeOdometryStep(TimeAt(odometry, row), duration, motion, config.default_odometry_noise));
  }
  return run;
}

ErrorStatistics ErrorsOf(const std::vector<Eigen::Vector2d>& positions,
                         const std::vector<Eigen::Vector2d>& truth,
                         std::size_t first) {
  std::vector<double> errors;
  errors.reserve(truth.size());
  for (std::size_t i = first; i < truth.size(); ++i) {
    errors.push_back((positions[i] - truth[i]).norm());
  }
  return Summarize(errors);
}

std::vector<Eigen::Vector2d> PositionsOf(const std::vector<SmootherEstimate>& estimates) {
  std::vector<Eigen::Vector2d> positions;
  positions.reserve(estimates.size());
  for (const SmootherEstimate& estimate : estimates) {
    positions.push_back(estimate.X_WB.translation());
  }
  return positions;
}

bool IsInEllipse95(const SmootherEstimate& estimate, const Eigen::Vector2d& truth) {
  const Eigen::Vector2d error_B = estimate.X_WB.Inverse() * truth;
  return SquaredMahalanobis(error_B, estimate.covariance.topLeftCorner<2, 2>()) <=
         kChiSquared95Dof2;
}

class NcltTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kFolder + "frames.csv")) {
      GTEST_SKIP() << "no " << kFolder << "frames.csv";
    }
    if (kIsSlowBuild) GTEST_SKIP() << "900 solutions take minutes under a sanitizer";
    run_ = ReadRun(config_);
    ASSERT_EQ(run_.truth.size(), 900U);
  }

  SmootherConfig config_;
  NcltRun run_;
};

TEST_F(NcltTest, CausalMedianIsBelowHalfOfTheReleasedOneAndTheCovarianceIsHonest) {
  constexpr std::size_t kFirst = 300;
  const std::vector<SmootherEstimate> estimates = SmoothCausally(run_.log, config_);
  const ErrorStatistics ours = ErrorsOf(PositionsOf(estimates), run_.truth, kFirst);
  const ErrorStatistics theirs = ErrorsOf(run_.released, run_.truth, kFirst);
  std::cout << "rows 300-899, causal: ours " << ours << "; released " << theirs << '\n';
  EXPECT_LT(ours.median, 0.5 * theirs.median);

  int inside = 0;
  int sure_and_wrong = 0;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const bool is_inside = IsInEllipse95(estimates[i], run_.truth[i]);
    if (is_inside && i >= kFirst) ++inside;
    if (!is_inside && estimates[i].status == SmootherStatus::kOk) ++sure_and_wrong;
    // The predictions of the first 80 s are far off, and nothing can know where to.
    if (i < 200) {
      EXPECT_NE(estimates[i].status, SmootherStatus::kOk) << "row " << i;
    }
  }
  const double share = inside / static_cast<double>(estimates.size() - kFirst);
  std::cout << "truth inside the 95 % ellipse: " << 100.0 * share
            << " % of rows 300-899; status ok "
            << "and truth outside: " << sure_and_wrong << " of all rows\n";
  EXPECT_GT(share, 0.9);
  EXPECT_LT(sure_and_wrong, 18);  // 2 %
}

TEST_F(NcltTest, SmoothedRmseIsBelowAThirdOfTheReleasedOne) {
  const std::vector<SmootherEstimate> estimates = SmoothAll(run_.log, config_);
  const ErrorStatistics ours = ErrorsOf(PositionsOf(estimates), run_.truth, 0);
  const ErrorStatistics theirs = ErrorsOf(run_.released, run_.truth, 0);
  std::cout << "all rows, smoothed: ours " << ours << "; released " << theirs << '\n';
  EXPECT_LT(ours.rmse, theirs.rmse / 3.0);
}

/// From a fix on, the estimates' errors are below this, or it has not been found again.
constexpr double kFound = 10.0;  // m
constexpr int kMostImages = 35;

/// So many fixes after `first` the error is below `kFound`.
int ImagesUntilFound(const std::vector<SmootherEstimate>& estimates,
                     const std::vector<Eigen::Vector2d>& truth,
                     std::size_t first) {
  for (std::size_t i = first; i < estimates.size(); ++i) {
    if ((estimates[i].X_WB.translation() - truth[i]).norm() < kFound)
      return static_cast<int>(i - first);
  }
  return -1;
}

TEST_F(NcltTest, ACarriedRobotIsFoundAgainAndSaysSo) {
  for (const Eigen::Vector2d& carried : {Eigen::Vector2d(60.0, 0.0), Eigen::Vector2d(0.0, -60.0)}) {
    NcltRun run = run_;
    constexpr std::size_t kFirst = 600;
    for (std::size_t i = kFirst; i < run.truth.size(); ++i) {
      run.truth[i] += carried;
      const Eigen::Vector2d p_WM = run.log.fixes[i].X_WB.translation() + carried;
      run.log.fixes[i].X_WB = Pose2(p_WM.x(), p_WM.y(), 0.0);
    }
    const std::vector<SmootherEstimate> estimates = SmoothCausally(run.log, config_);
    const int images = ImagesUntilFound(estimates, run.truth, kFirst);
    std::cout << "carried by 60 m: found again after " << images << " images\n";
    EXPECT_GE(images, 0);
    EXPECT_LE(images, kMostImages);
    bool was_lost = false;
    for (std::size_t i = kFirst; i < kFirst + kMostImages; ++i)
      was_lost = was_lost || estimates[i].status == SmootherStatus::kLost;
    EXPECT_TRUE(was_lost);
  }
}

/// The run from row 300 on, from where the predictions are usable.
TEST_F(NcltTest, APriorAHundredMetresOffAndTurnedIsOverruled) {
  constexpr std::size_t kFirst = 300;
  FixedLagSmoother smoother(config_);
  const Pose2 wrong(
      run_.truth[kFirst].x() + 80.0, run_.truth[kFirst].y() - 60.0, 1.68);  // by 180 deg
  std::size_t step = 0;
  std::vector<SmootherEstimate> estimates;
  std::vector<Eigen::Vector2d> truth;
  for (std::size_t i = kFirst; i < run_.truth.size(); ++i) {
    for (;
         step < run_.log.odometry.size() && run_.log.odometry[step].time <= run_.log.fixes[i].time;
         ++step) {
      if (run_.log.odometry[step].time < run_.log.fixes[kFirst - 1].time) continue;
      ASSERT_TRUE(smoother.AddOdometry(run_.log.odometry[step]));
    }
    if (i == kFirst) {
      ASSERT_TRUE(smoother.Reset(
          {.X_WB = wrong, .covariance = Eigen::Vector3d(1.0, 1.0, 0.0025).asDiagonal()}));
    }
    smoother.AddFix(run_.log.fixes[i]);
    estimates.push_back(smoother.Estimate());
    truth.push_back(run_.truth[i]);
  }
  const int images = ImagesUntilFound(estimates, truth, 0);
  std::cout << "prior 100 m and far turned: found after " << images << " images\n";
  EXPECT_GE(images, 0);
  EXPECT_LE(images, kMostImages);
}

TEST_F(NcltTest, NothingIsStartedAnewWhereNothingHappened) {
  FixedLagSmoother smoother(config_);
  std::size_t step = 0;
  for (const Fix& fix : run_.log.fixes) {
    for (; step < run_.log.odometry.size() && run_.log.odometry[step].time <= fix.time; ++step)
      ASSERT_TRUE(smoother.AddOdometry(run_.log.odometry[step]));
    smoother.AddFix(fix);
  }
  EXPECT_EQ(smoother.counters().relocalizations, 0);
}

TEST_F(NcltTest, GivesTheSameBitsTwice) {
  run_.log.fixes.resize(250);
  const std::vector<SmootherEstimate> first = SmoothCausally(run_.log, config_);
  const std::vector<SmootherEstimate> second = SmoothCausally(run_.log, config_);
  for (std::size_t i = 0; i < first.size(); ++i) {
    ASSERT_EQ(first[i].X_WB.x(), second[i].X_WB.x()) << "row " << i;
    ASSERT_EQ(first[i].X_WB.yaw(), second[i].X_WB.yaw()) << "row " << i;
    ASSERT_EQ(first[i].covariance, second[i].covariance) << "row " << i;
  }
}

}  // namespace
}  // namespace relocd
