#include "smoothing/fixed_lag_smoother.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/covariance.h"
#include "smoothing/batch_solver.h"
#include "smoothing/offline_smoother.h"
#include "smoothing/simulated_drive.h"
#include "support/error_statistics.h"
#include "support/slow_build.h"

namespace relocd {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr unsigned kSeeds = kIsSlowBuild ? 1 : 6;

double PositionError(const Pose2& X_WB, const Pose2& truth) {
  return (X_WB.translation() - truth.translation()).norm();
}

/// Feeds odometry up to each fix's time and then the fix, `delay` fixes late.
SmootherEstimate Drive(const SimulatedDrive& drive,
                       FixedLagSmoother& smoother,
                       std::size_t delay = 0) {
  std::size_t step = 0;
  for (std::size_t i = 0; i < drive.log.fixes.size(); ++i) {
    const MonotonicTime now = drive.log.fixes[i].time;
    for (; step < drive.log.odometry.size() && drive.log.odometry[step].time <= now; ++step) {
      EXPECT_TRUE(smoother.AddOdometry(drive.log.odometry[step]));
    }
    if (i >= delay) smoother.AddFix(drive.log.fixes[i - delay]);
  }
  for (std::size_t i = drive.log.fixes.size() - delay; i < drive.log.fixes.size(); ++i) {
    smoother.AddFix(drive.log.fixes[i]);
  }
  for (; step < drive.log.odometry.size(); ++step) {
    EXPECT_TRUE(smoother.AddOdometry(drive.log.odometry[step]));
  }
  return smoother.Estimate();
}

/// How the errors compare with the reported covariances, after the start.
struct Honesty {
  double share_in_ellipse95 = 0.0;
  double nees_per_dof = 0.0;
};

Honesty MeasureHonesty(const DriveOptions& options, const SmootherConfig& config) {
  constexpr unsigned kDrives = 10;
  constexpr std::size_t kFirst = 50;
  int inside = 0;
  int count = 0;
  double nees = 0.0;
  for (unsigned seed = 0; seed < kDrives; ++seed) {
    const auto drive = DriveSimulator(options, seed).Run();
    const auto estimates = SmoothCausally(drive.log, config);
    for (std::size_t i = kFirst; i < estimates.size(); ++i) {
      const Eigen::Vector3d error = (estimates[i].X_WB.Inverse() * drive.truth_at_fixes[i]).Log();
      const Eigen::Matrix3d& covariance = estimates[i].covariance;
      const Eigen::Matrix2d position = covariance.topLeftCorner<2, 2>();
      ++count;
      nees += SquaredMahalanobis(error, covariance) / 3.0;
      if (SquaredMahalanobis(error.head<2>(), position) <= kChiSquared95Dof2) ++inside;
    }
  }
  return {.share_in_ellipse95 = static_cast<double>(inside) / count, .nees_per_dof = nees / count};
}

TEST(FixedLagSmootherTest, ReportsACovarianceThatTheTruthLiesIn) {
  if (kIsSlowBuild) GTEST_SKIP() << "3,200 solutions take minutes under a sanitizer";
  for (const bool has_heading : {true, false}) {
    const Honesty honesty = MeasureHonesty({.duration_s = 160.0, .has_heading = has_heading},
                                           ConfigForIndependentErrors());
    std::cout << (has_heading ? "poses" : "positions") << ": truth in the 95 % ellipse "
              << 100.0 * honesty.share_in_ellipse95 << " %, NEES per degree of freedom "
              << honesty.nees_per_dof << '\n';
    EXPECT_GT(honesty.share_in_ellipse95, 0.90);
    EXPECT_LT(honesty.share_in_ellipse95, 0.985);
    EXPECT_GT(honesty.nees_per_dof, 0.5);
    EXPECT_LT(honesty.nees_per_dof, 1.3);
  }
}

TEST(FixedLagSmootherTest, AllowsForFixesThatErrTogether) {
  if (kIsSlowBuild) GTEST_SKIP() << "thousands of solutions take minutes under a sanitizer";
  const DriveOptions options{
      .duration_s = 160.0, .fix_rate_hz = 5.0, .has_heading = false, .bias_sigmas = 0.8};
  SmootherConfig config = ConfigForIndependentErrors();
  const Honesty as_if_independent = MeasureHonesty(options, config);
  config.fix_bias_sigmas = 0.8;
  const Honesty biased = MeasureHonesty(options, config);
  std::cout << "fixes that err together: truth in the 95 % ellipse "
            << 100.0 * biased.share_in_ellipse95 << " %, not allowed for "
            << 100.0 * as_if_independent.share_in_ellipse95 << " %\n";
  EXPECT_LT(as_if_independent.share_in_ellipse95, 0.85);
  EXPECT_GT(biased.share_in_ellipse95, 0.90);
  EXPECT_LT(biased.share_in_ellipse95, 0.995);  // the misfit sees a part of the bias as well
}

TEST(FixedLagSmootherTest, BeatsTheFixes) {
  std::vector<double> errors;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const auto drive = DriveSimulator({}, seed).Run();
    FixedLagSmoother smoother{SmootherConfig()};
    const SmootherEstimate estimate = Drive(drive, smoother);
    EXPECT_EQ(estimate.status, SmootherStatus::kOk);
    EXPECT_EQ(smoother.counters().relocalizations, 0);
    errors.push_back(PositionError(estimate.X_WB, drive.X_WB_end));
  }
  EXPECT_LT(Summarize(errors).rmse, 0.25);  // a fix alone: 0.42
}

TEST(FixedLagSmootherTest, HalfOfTheFixesBeingWrongDoesNotMoveIt) {
  for (const bool has_heading : {true, false}) {
    std::vector<double> errors;
    for (unsigned seed = 0; seed < kSeeds; ++seed) {
      const auto drive =
          DriveSimulator({.outlier_share = 0.5, .has_heading = has_heading}, seed).Run();
      FixedLagSmoother smoother{SmootherConfig()};
      const SmootherEstimate estimate = Drive(drive, smoother);
      EXPECT_EQ(smoother.counters().relocalizations, 0) << seed;
      EXPECT_GT(smoother.counters().fixes_gated, 20) << seed;
      errors.push_back(PositionError(estimate.X_WB, drive.X_WB_end));
    }
    EXPECT_LT(Summarize(errors).rmse, 0.4) << has_heading;
    EXPECT_LT(Summarize(errors).max, 1.0) << has_heading;
  }
}

TEST(FixedLagSmootherTest, IsAtTheMinimumOfItsWindow) {
  const auto drive = DriveSimulator({.outlier_share = 0.2}, 1).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  const Pose2 X_WB = Drive(drive, smoother).X_WB;
  const Pose2 X_KB = smoother.window().keyframes.back().X_WK().Inverse() * X_WB;
  const FixWeighting weighting = smoother.weighting();
  KeyframeWindow window = smoother.window();
  ASSERT_TRUE(SolveBatch(window, weighting, 200));
  EXPECT_LT(PositionError(window.keyframes.back().X_WK() * X_KB, X_WB), 0.06);
}

TEST(FixedLagSmootherTest, AShortWindowAgreesWithTheWholeDrive) {
  const auto drive = DriveSimulator({.duration_s = 240.0}, 2).Run();
  SmootherConfig config = ConfigForIndependentErrors();
  FixedLagSmoother whole(config);
  config.window_keyframes = 200;
  FixedLagSmoother shortened(config);
  const SmootherEstimate expected = Drive(drive, whole);
  const SmootherEstimate estimate = Drive(drive, shortened);
  EXPECT_EQ(shortened.window().keyframes.size(), 200U);
  EXPECT_LT(PositionError(estimate.X_WB, expected.X_WB), 0.05);
}

TEST(FixedLagSmootherTest, LateFixesGiveWhatFixesInOrderGive) {
  const auto drive = DriveSimulator({}, 3).Run();
  FixedLagSmoother in_order{SmootherConfig()};
  FixedLagSmoother late{SmootherConfig()};
  const SmootherEstimate expected = Drive(drive, in_order);
  const SmootherEstimate estimate = Drive(drive, late, 5);
  // Not the same: the odometry's drift was known later.
  EXPECT_LT(PositionError(estimate.X_WB, expected.X_WB), 0.03);
  EXPECT_NEAR(estimate.X_WB.yaw(), expected.X_WB.yaw(), 3e-3);
}

TEST(FixedLagSmootherTest, SwappedFixesGiveWhatFixesInOrderGive) {
  auto drive = DriveSimulator({}, 4).Run();
  FixedLagSmoother in_order{SmootherConfig()};
  FixedLagSmoother swapped{SmootherConfig()};
  const SmootherEstimate expected = Drive(drive, in_order);
  for (std::size_t i = 21; i + 1 < drive.log.fixes.size(); i += 2) {
    std::swap(drive.log.fixes[i], drive.log.fixes[i + 1]);
  }
  const SmootherEstimate estimate = Drive(drive, swapped);
  EXPECT_LT(PositionError(estimate.X_WB, expected.X_WB), 0.02);
}

TEST(FixedLagSmootherTest, AFixFromBeforeTheOdometryKeptIsRefusedAndCounted) {
  const auto drive = DriveSimulator({}, 5).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  Drive(drive, smoother);
  EXPECT_EQ(smoother.AddFix(drive.log.fixes.front()), FixOutcome::kLate);
  EXPECT_EQ(smoother.counters().fixes_late, 1);
}

TEST(FixedLagSmootherTest, AFixAheadOfTheOdometryIsPutInItsPlaceWhenTheOdometryComes) {
  const auto drive = DriveSimulator({}, 6).Run();
  FixedLagSmoother on_time{SmootherConfig()};
  FixedLagSmoother ahead{SmootherConfig()};
  std::size_t next_fix = 0;
  for (const OdometryStep& step : drive.log.odometry) {
    // In the second, each fix comes before the odometry of the same moment.
    const bool has_fix =
        next_fix < drive.log.fixes.size() && drive.log.fixes[next_fix].time == step.time;
    if (has_fix) ahead.AddFix(drive.log.fixes[next_fix]);
    ASSERT_TRUE(on_time.AddOdometry(step));
    ASSERT_TRUE(ahead.AddOdometry(step));
    if (has_fix) on_time.AddFix(drive.log.fixes[next_fix++]);
  }
  EXPECT_EQ(ahead.counters().fixes_ahead, 1);  // the first, without any odometry
  EXPECT_LT(PositionError(ahead.Estimate().X_WB, on_time.Estimate().X_WB), 0.1);
}

/// The later fix comes first, and a keyframe between the two; then the oldest keyframes leave.
TEST(FixedLagSmootherTest, FixesThatAreAheadStayInTheOrderOfTheKeyframes) {
  SmootherConfig config;
  config.window_keyframes = 2;
  FixedLagSmoother smoother(config);
  OdometryStep step;
  step.X_BprevB = Pose2(1.0, 0.0, 0.0);
  step.covariance = 1e-4 * Eigen::Matrix3d::Identity();
  Fix fix;
  const auto drive = [&](int count) {
    for (int i = 0; i < count; ++i) {
      step.time += milliseconds(100);
      ASSERT_TRUE(smoother.AddOdometry(step));
    }
  };
  drive(3);
  fix.time = step.time + milliseconds(350);
  EXPECT_EQ(smoother.AddFix(fix), FixOutcome::kAccepted);
  drive(1);
  fix.time = step.time + milliseconds(150);
  EXPECT_EQ(smoother.AddFix(fix), FixOutcome::kAccepted);
  drive(1);
  for (const AttachedFix& attached : smoother.window().fixes)
    EXPECT_TRUE(smoother.window().Has(attached.keyframe_id));
  drive(5);
  EXPECT_EQ(smoother.window().fixes.size(), 0U);
}

TEST(FixedLagSmootherTest, CrossesPiWithoutNoticing) {
  for (const double yaw : {std::numbers::pi, -std::numbers::pi, 0.5 * std::numbers::pi}) {
    const auto drive = DriveSimulator({.X_WB0 = Pose2(0.0, 0.0, yaw)}, 7).Run();
    FixedLagSmoother smoother{SmootherConfig()};
    const SmootherEstimate estimate = Drive(drive, smoother);
    EXPECT_LT(PositionError(estimate.X_WB, drive.X_WB_end), 0.6) << yaw;
    EXPECT_EQ(smoother.counters().relocalizations, 0);
    EXPECT_EQ(smoother.counters().fixes_gated, 0);
  }
}

TEST(FixedLagSmootherTest, RecoversFromAConfidentWrongPrior) {
  for (const bool has_heading : {true, false}) {
    const DriveOptions options{.duration_s = 60.0, .has_heading = has_heading};
    const auto drive = DriveSimulator(options, 8).Run();
    FixedLagSmoother smoother{SmootherConfig()};
    const Pose2 wrong(
        options.X_WB0.x() + 80.0, options.X_WB0.y() - 60.0, options.X_WB0.yaw() + std::numbers::pi);
    ASSERT_TRUE(smoother.Reset(
        {.X_WB = wrong, .covariance = Eigen::Vector3d(0.01, 0.01, 1e-4).asDiagonal()}));
    const SmootherEstimate estimate = Drive(drive, smoother);
    EXPECT_LT(PositionError(estimate.X_WB, drive.X_WB_end), 0.6) << has_heading;
    EXPECT_EQ(smoother.counters().relocalizations, 1) << has_heading;
  }
}

/// The fixes until the estimate is near the truth again after the body was carried 60 m.
int FixesUntilFound(bool has_heading, unsigned seed) {
  DriveOptions options{.duration_s = 120.0, .has_heading = has_heading};
  const auto before = DriveSimulator(options, seed).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  Drive(before, smoother);
  options.X_WB0 = before.X_WB_end * Pose2(-36.0, 48.0, 1.5);
  auto after = DriveSimulator(options, seed + 100).Run();
  const Duration shift =
      before.log.odometry.back().time - after.log.odometry.front().time + milliseconds(50);
  std::size_t step = 0;
  int found_at = -1;
  bool was_lost = false;
  for (std::size_t i = 0; i < after.log.fixes.size(); ++i) {
    for (; step < after.log.odometry.size() &&
           after.log.odometry[step].time <= after.log.fixes[i].time;
         ++step) {
      after.log.odometry[step].time += shift;
      EXPECT_TRUE(smoother.AddOdometry(after.log.odometry[step]));
      after.log.odometry[step].time -= shift;
    }
    Fix fix = after.log.fixes[i];
    fix.time += shift;
    smoother.AddFix(fix);
    const SmootherEstimate estimate = smoother.Estimate();
    was_lost = was_lost || estimate.status == SmootherStatus::kLost;
    const bool is_near = PositionError(estimate.X_WB, after.truth_at_fixes[i]) < 1.5;
    if (!is_near) found_at = -1;
    if (is_near && found_at < 0) found_at = static_cast<int>(i);
  }
  EXPECT_TRUE(was_lost);
  EXPECT_EQ(smoother.counters().relocalizations, 1);
  return found_at;
}

TEST(FixedLagSmootherTest, FindsACarriedBodyAgain) {
  for (unsigned seed = 0; seed < (kIsSlowBuild ? 1U : 5U); ++seed) {
    for (const bool has_heading : {true, false}) {
      const int fixes = FixesUntilFound(has_heading, seed);
      EXPECT_GE(fixes, 0) << seed;
      EXPECT_LE(fixes, 35) << seed;
    }
  }
}

TEST(FixedLagSmootherTest, StandingStillCostsNothing) {
  const auto drive = DriveSimulator({}, 9).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  Drive(drive, smoother);
  const std::size_t keyframes = smoother.window().keyframes.size();
  const std::size_t fixes = smoother.window().fixes.size();
  MonotonicTime time = drive.log.odometry.back().time;
  DriveSimulator simulator({}, 10);
  for (int i = 0; i < 36000; ++i) {  // an hour at 10 Hz
    time += milliseconds(100);
    OdometryStep step;
    step.time = time;
    step.covariance = 1e-10 * Eigen::Matrix3d::Identity();
    ASSERT_TRUE(smoother.AddOdometry(step));
    smoother.AddFix(simulator.MakeFix(time, drive.X_WB_end));
  }
  EXPECT_LE(smoother.window().keyframes.size(), keyframes + 1);
  EXPECT_LE(smoother.window().fixes.size(), fixes + 60);
  EXPECT_GT(smoother.counters().fixes_redundant, 35000);
  EXPECT_EQ(smoother.Estimate().status, SmootherStatus::kOk);
  EXPECT_LT(PositionError(smoother.Estimate().X_WB, drive.X_WB_end), 0.6);
}

/// A robot that stands where the images look like two places, now like the one, now like the other.
TEST(FixedLagSmootherTest, StandingBetweenTwoPlacesTakesNoMoreAndMoreMemory) {
  const auto drive = DriveSimulator({}, 9).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  Drive(drive, smoother);
  const std::size_t fixes = smoother.window().fixes.size();
  DriveSimulator simulator({}, 10);
  OdometryStep step = drive.log.odometry.back();
  step.X_BprevB = Pose2();
  step.covariance = 1e-10 * Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3600; ++i) {
    step.time += milliseconds(500);
    ASSERT_TRUE(smoother.AddOdometry(step));
    const double away_m = i / 60 % 2 == 0 ? 30.0 : 0.0;
    smoother.AddFix(simulator.MakeFix(step.time, drive.X_WB_end * Pose2(away_m, 0.0, 0.0)));
  }
  EXPECT_GT(smoother.counters().relocalizations, 20);
  EXPECT_LE(smoother.window().fixes.size(), fixes + 32);
}

TEST(FixedLagSmootherTest, RefusesWhatIsNotFinite) {
  const auto drive = DriveSimulator({}, 11).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  const Pose2 before = Drive(drive, smoother).X_WB;
  Fix fix = drive.log.fixes.back();
  fix.X_WB = Pose2(std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0);
  EXPECT_EQ(smoother.AddFix(fix), FixOutcome::kInvalid);
  fix = drive.log.fixes.back();
  fix.covariance(0, 0) = -1.0;
  EXPECT_EQ(smoother.AddFix(fix), FixOutcome::kInvalid);
  fix.covariance(0, 0) = 1e308;
  EXPECT_EQ(smoother.AddFix(fix), FixOutcome::kInvalid);
  fix = drive.log.fixes.back();
  fix.X_WB = Pose2(0.0, 1e300, 0.0);  // finite, and its square is not
  EXPECT_EQ(smoother.AddFix(fix), FixOutcome::kInvalid);
  fix.has_heading = false;
  EXPECT_EQ(smoother.AddFix(fix), FixOutcome::kInvalid);
  EXPECT_EQ(smoother.counters().fixes_invalid, 5);

  OdometryStep step = drive.log.odometry.back();
  EXPECT_FALSE(smoother.AddOdometry(step));  // the same time once more
  step.time += seconds(1);
  step.X_BprevB = Pose2(0.0, 0.0, std::numeric_limits<double>::infinity());
  const auto refused = smoother.AddOdometry(step);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, ErrorKind::kInvalidInput);
  step.X_BprevB = Pose2(1e300, 0.0, 0.0);
  EXPECT_FALSE(smoother.AddOdometry(step));
  EXPECT_EQ(smoother.counters().odometry_refused, 3);
  EXPECT_EQ(smoother.Estimate().X_WB.translation(), before.translation());

  EXPECT_FALSE(smoother.Reset({.X_WB = Pose2(), .covariance = Eigen::Matrix3d::Zero()}));
  EXPECT_FALSE(
      smoother.Reset({.X_WB = Pose2(-1e300, 0.0, 0.0), .covariance = Eigen::Matrix3d::Identity()}));
}

TEST(FixedLagSmootherTest, RefusesWhatComesBeforeOrLongAfterTheOdometry) {
  const auto drive = DriveSimulator({}, 14).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  EXPECT_EQ(smoother.AddFix(drive.log.fixes.front()), FixOutcome::kAhead);  // no odometry yet
  const SmootherEstimate before = Drive(drive, smoother);
  Fix fix = drive.log.fixes.back();
  for (const int hours : {-1000, -2, 2, 1000}) {
    fix.time = drive.log.fixes.back().time + std::chrono::hours(hours);
    EXPECT_EQ(smoother.AddFix(fix), hours < 0 ? FixOutcome::kLate : FixOutcome::kAhead) << hours;
  }
  EXPECT_EQ(smoother.counters().fixes_late, 2);
  EXPECT_EQ(smoother.counters().fixes_ahead, 3);
  OdometryStep step = drive.log.odometry.back();
  step.time -= std::chrono::hours(3);
  EXPECT_FALSE(smoother.AddOdometry(step));
  EXPECT_EQ(smoother.counters().odometry_refused, 1);
  EXPECT_EQ(smoother.Estimate().X_WB.translation(), before.X_WB.translation());
  // Hours in which nothing came: the body has not moved further than the odometry says.
  step = drive.log.odometry.back();
  step.time += std::chrono::hours(3);
  EXPECT_TRUE(smoother.AddOdometry(step));
  EXPECT_EQ(smoother.Estimate().status, SmootherStatus::kDeadReckoning);
  EXPECT_TRUE(smoother.Estimate().X_WB.translation().allFinite());
}

TEST(FixedLagSmootherTest, OdometryThatStopsLeavesFixesOutAndGoesOn) {
  const auto drive = DriveSimulator({}, 15).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  const std::size_t half = drive.log.odometry.size() / 2;
  const MonotonicTime stop = drive.log.odometry[half].time;
  std::size_t step = 0;
  for (const Fix& fix : drive.log.fixes) {
    for (; step <= half && drive.log.odometry[step].time <= fix.time; ++step)
      ASSERT_TRUE(smoother.AddOdometry(drive.log.odometry[step]));
    const FixOutcome outcome = smoother.AddFix(fix);
    if (fix.time > stop + seconds(1)) {
      EXPECT_EQ(outcome, FixOutcome::kAhead);
    }
    EXPECT_TRUE(smoother.Estimate().X_WB.translation().allFinite());
  }
  EXPECT_GT(smoother.counters().fixes_ahead, 50);
}

/// The drive's odometry, as wheels of another radius than the config's measure it.
void Distort(double rad_per_m, double scale, std::vector<OdometryStep>& odometry) {
  for (OdometryStep& step : odometry) {
    const Pose2& motion = step.X_BprevB;
    step.X_BprevB = Pose2(scale * motion.x(),
                          scale * motion.y(),
                          motion.yaw() + rad_per_m * motion.translation().norm());
  }
}

TEST(FixedLagSmootherTest, LearnsTheOdometrysConstantErrors) {
  std::vector<double> learning;
  std::vector<double> not_learning;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    auto drive = DriveSimulator({.duration_s = 300.0, .has_heading = false}, seed).Run();
    Distort(-0.004, 0.99, drive.log.odometry);
    FixedLagSmoother smoother{SmootherConfig()};
    const SmootherEstimate estimate = Drive(drive, smoother);
    learning.push_back(PositionError(estimate.X_WB, drive.X_WB_end));
    EXPECT_NEAR(smoother.systematic_errors().odometry_rad_per_m(), 0.004, 0.001) << seed;
    EXPECT_NEAR(smoother.systematic_errors().odometry_scale(), 0.01, 0.006) << seed;
    SmootherConfig config;
    config.odometry_drift_sigma_rad_per_m = 0.0;
    config.odometry_scale_sigma = 0.0;
    FixedLagSmoother other(config);
    not_learning.push_back(PositionError(Drive(drive, other).X_WB, drive.X_WB_end));
  }
  EXPECT_LT(Summarize(learning).rmse, Summarize(not_learning).rmse);
}

/// What a drift of -0.004 rad/s, at 1.5 m/s, is found to be.
SystematicErrors ErrorsOfASensorWithABias(const SmootherConfig& config, unsigned seed) {
  auto drive = DriveSimulator({.duration_s = 300.0, .has_heading = false}, seed).Run();
  std::vector<OdometryStep>& odometry = drive.log.odometry;
  for (std::size_t i = 1; i < odometry.size(); ++i) {
    const double period_s = ToSeconds(odometry[i].time - odometry[i - 1].time);
    odometry[i].X_BprevB = odometry[i].X_BprevB * Pose2(0.0, 0.0, -0.004 * period_s);
  }
  FixedLagSmoother smoother(config);
  const SmootherEstimate estimate = Drive(drive, smoother);
  EXPECT_LT(PositionError(estimate.X_WB, drive.X_WB_end), 0.6) << seed;
  return smoother.systematic_errors();
}

TEST(FixedLagSmootherTest, LearnsTheBiasOfAYawRateSensor) {
  SmootherConfig only;
  only.odometry_drift_sigma_rad_per_m = 0.0;
  only.odometry_yaw_rate_sigma_rad_per_s = 0.01;
  SmootherConfig both;
  both.odometry_yaw_rate_sigma_rad_per_s = 1.5 * both.odometry_drift_sigma_rad_per_m;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const SystematicErrors found = ErrorsOfASensorWithABias(only, seed);
    EXPECT_NEAR(found.odometry_rad_per_s(), 0.004, 0.001) << seed;
    EXPECT_EQ(found.odometry_rad_per_m(), 0.0);
    // One speed does not tell them apart: each gets its half.
    const SystematicErrors shared = ErrorsOfASensorWithABias(both, seed);
    EXPECT_NEAR(shared.odometry_rad_per_s(), 0.002, 0.0007) << seed;
    EXPECT_NEAR(shared.odometry_rad_per_m(), 0.002 / 1.5, 0.0005) << seed;
  }
}

TEST(FixedLagSmootherTest, DoesNotTurnABodyThatStands) {
  SmootherConfig config;
  config.odometry_yaw_rate_sigma_rad_per_s = 0.01;
  const auto drive = DriveSimulator({.duration_s = 100.0}, 3).Run();
  FixedLagSmoother smoother(config);
  const SmootherEstimate before = Drive(drive, smoother);
  OdometryStep step = drive.log.odometry.back();
  step.X_BprevB = Pose2();
  for (int i = 0; i < 1000; ++i) {
    step.time += milliseconds(50);
    ASSERT_TRUE(smoother.AddOdometry(step));
  }
  EXPECT_NE(smoother.systematic_errors().odometry_rad_per_s(), 0.0);
  EXPECT_EQ(smoother.Estimate().X_WB.yaw(), before.X_WB.yaw());
}

/// A car whose encoders are good, as its covariances say, and whose radii are not: they differ, or
/// all are larger than the config says.
SimulatedDrive DriveOfGoodEncodersAndPoorRadii(unsigned seed,
                                               double rad_per_m = 0.007,
                                               double scale = 1.005) {
  DriveSimulator simulator({.duration_s = 100.0,
                            .fix_rate_hz = 5.0,
                            .speed_mps = 8.0,
                            .fix_sigma_m = 0.5,
                            .outlier_share = 0.3,
                            .has_heading = false},
                           seed);
  SimulatedDrive drive = simulator.Run();
  Distort(seed % 2 == 0 ? rad_per_m : -rad_per_m, scale, drive.log.odometry);
  for (OdometryStep& step : drive.log.odometry)
    step.covariance *= 0.3;
  return drive;
}

void ExpectNeverLost(const SimulatedDrive& drive, double largest_rmse_m, unsigned seed) {
  const auto estimates = SmoothCausally(drive.log, SmootherConfig());
  std::vector<double> errors;
  for (std::size_t i = 30; i < estimates.size(); ++i) {
    EXPECT_NE(estimates[i].status, SmootherStatus::kLost) << seed << ' ' << i;
    errors.push_back(PositionError(estimates[i].X_WB, drive.truth_at_fixes[i]));
  }
  EXPECT_LT(Summarize(errors).rmse, largest_rmse_m) << seed;
}

TEST(FixedLagSmootherTest, IsNotLostByWheelsThatTurnMoreThanTheySay) {
  for (unsigned seed = 0; seed < kSeeds; ++seed)
    ExpectNeverLost(DriveOfGoodEncodersAndPoorRadii(seed), 0.6, seed);
}

TEST(FixedLagSmootherTest, IsNotLostByWheelsOfAnotherSize) {
  for (unsigned seed = 0; seed < kSeeds; ++seed)
    ExpectNeverLost(DriveOfGoodEncodersAndPoorRadii(seed, 0.0, 0.95), 0.7, seed);
}

TEST(FixedLagSmootherTest, DeadReckoningIsAsUncertainAsTheWheelsAre) {
  const auto drive = DriveSimulator({.duration_s = 20.0}, 1).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  const SmootherEstimate before = Drive(drive, smoother);
  const SystematicVector sigmas = smoother.systematic_errors().Sigmas();
  OdometryStep step = drive.log.odometry.back();
  step.X_BprevB = Pose2(0.1, 0.0, 0.0);
  step.covariance = 1e-9 * Eigen::Matrix3d::Identity();
  for (int i = 0; i < 2000; ++i) {
    step.time += milliseconds(50);
    ASSERT_TRUE(smoother.AddOdometry(step));
  }
  const SmootherEstimate after = smoother.Estimate();
  const double way_m = 200.0;
  EXPECT_GT(sigmas[3], 1e-3);
  EXPECT_GT(std::sqrt(after.covariance(0, 0)), 0.9 * sigmas[2] * way_m);
  EXPECT_NEAR(std::sqrt(after.covariance(2, 2) - before.covariance(2, 2)),
              sigmas[3] * way_m,
              0.1 * sigmas[3] * way_m);
  // The turn of each metre has turned the way behind it as well.
  EXPECT_NEAR(std::sqrt(after.covariance(1, 1)),
              0.5 * sigmas[3] * way_m * way_m,
              0.2 * 0.5 * sigmas[3] * way_m * way_m);
}

TEST(SmoothAllTest, PutsTheOdometryRightFromTheBeginning) {
  std::vector<double> errors;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const SimulatedDrive drive = DriveOfGoodEncodersAndPoorRadii(seed);
    const auto estimates = SmoothAll(drive.log, SmootherConfig());
    for (std::size_t i = 0; i < 50; ++i)
      errors.push_back(PositionError(estimates[i].X_WB, drive.truth_at_fixes[i]));
  }
  EXPECT_LT(Summarize(errors).rmse, 0.35);
}

/// A car whose wheels err by one percent of the root of a metre, and a camera that is turned and
/// late.
DriveOptions DriveWithOffsetCamera(double turn_rad_per_m) {
  return {.duration_s = 200.0,
          .fix_rate_hz = 5.0,
          .speed_mps = 6.0,
          .outlier_share = 0.1,
          .camera_yaw_rad = 0.0175,
          .camera_time_s = 0.08,
          .turn_rad_per_m = turn_rad_per_m,
          .noise = {.forward_sigma_m_per_sqrt_m = 0.01}};
}

SmootherConfig ConfigOfOffsetCamera() {
  SmootherConfig config;
  config.camera_yaw_sigma_rad = 0.05;
  config.camera_time_sigma_s = 0.1;
  return config;
}

TEST(FixedLagSmootherTest, LearnsHowTheCameraIsTurnedAndHowLateItIs) {
  std::vector<double> learning;
  std::vector<double> not_learning;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const auto drive = DriveSimulator(DriveWithOffsetCamera(0.15), seed).Run();
    FixedLagSmoother smoother(ConfigOfOffsetCamera());
    learning.push_back(PositionError(Drive(drive, smoother).X_WB, drive.X_WB_end));
    const SystematicErrors& camera = smoother.systematic_errors();
    const SystematicVector sigmas = camera.Sigmas();
    EXPECT_LT(sigmas.x(), 0.006);
    EXPECT_LT(sigmas.y(), 0.03);
    EXPECT_NEAR(camera.camera_yaw_rad(), 0.0175, 3.0 * sigmas.x()) << seed;
    EXPECT_NEAR(camera.camera_time_s(), 0.08, 3.0 * sigmas.y()) << seed;
    FixedLagSmoother other{SmootherConfig()};
    not_learning.push_back(PositionError(Drive(drive, other).X_WB, drive.X_WB_end));
    EXPECT_TRUE(CameraPart(other.systematic_errors().estimate).isZero(0.0));
  }
  std::cout << "position: rmse " << Summarize(learning).rmse << " m, not learning "
            << Summarize(not_learning).rmse << " m\n";
  EXPECT_LT(Summarize(learning).rmse, 0.7 * Summarize(not_learning).rmse);
}

/// Straight on at one speed the fixes of a late camera are those of a body farther back.
TEST(FixedLagSmootherTest, KnowsThatAStraightRoadDoesNotTellHowLateTheCameraIs) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const auto drive = DriveSimulator(DriveWithOffsetCamera(0.0), seed).Run();
    FixedLagSmoother smoother(ConfigOfOffsetCamera());
    const SmootherEstimate estimate = Drive(drive, smoother);
    const double sigma_s = std::sqrt(smoother.systematic_errors().covariance(1, 1));
    EXPECT_GT(sigma_s, 0.08) << seed;
    EXPECT_NEAR(smoother.systematic_errors().camera_time_s(), 0.08, 3.0 * sigma_s) << seed;
    // What that may be on the road is part of the covariance.
    EXPECT_GT(std::sqrt(estimate.covariance(0, 0)), 0.9 * 6.0 * sigma_s) << seed;
  }
}

TEST(FixedLagSmootherTest, PositionsDoNotTellHowTheCameraIsTurned) {
  DriveOptions options = DriveWithOffsetCamera(0.15);
  options.has_heading = false;
  const auto drive = DriveSimulator(options, 1).Run();
  FixedLagSmoother smoother(ConfigOfOffsetCamera());
  Drive(drive, smoother);
  EXPECT_NEAR(smoother.systematic_errors().camera_yaw_rad(), 0.0, 1e-9);
  EXPECT_NEAR(smoother.systematic_errors().covariance(0, 0), 0.05 * 0.05, 1e-9);
}

/// A camera at the front that looks to the left has the body turned about the camera: its middle to
/// the right of where it is.
TEST(FixedLagSmootherTest, ATurnedCameraMovesTheBodyAboutTheCamera) {
  auto drive = DriveSimulator({.fix_rate_hz = 5.0}, 3).Run();
  const double turn = 0.05;
  const Eigen::Vector2d p_BC(10.0, 0.0);
  for (Fix& fix : drive.log.fixes) {
    const Eigen::Vector2d p_turned = Eigen::Rotation2Dd(turn) * p_BC;
    const Eigen::Vector2d moved = p_BC - p_turned;
    fix.X_WB = fix.X_WB * Pose2(moved.x(), moved.y(), turn);
    fix.p_BC = p_BC;
  }
  SmootherConfig config;
  config.camera_yaw_sigma_rad = 0.05;
  FixedLagSmoother smoother(config);
  const SmootherEstimate estimate = Drive(drive, smoother);
  const double sigma = std::sqrt(smoother.systematic_errors().covariance(0, 0));
  EXPECT_LT(sigma, 0.01);
  EXPECT_NEAR(smoother.systematic_errors().camera_yaw_rad(), turn, 3.0 * sigma);
  EXPECT_LT(PositionError(estimate.X_WB, drive.X_WB_end), 0.3);
}

TEST(FixedLagSmootherTest, RefusesAFixBeforeItKnowsHowFastTheBodyIsWhereThatMatters) {
  const auto drive = DriveSimulator({}, 1).Run();
  FixedLagSmoother smoother(ConfigOfOffsetCamera());
  FixedLagSmoother other{SmootherConfig()};
  ASSERT_TRUE(smoother.AddOdometry(drive.log.odometry.front()));
  ASSERT_TRUE(other.AddOdometry(drive.log.odometry.front()));
  EXPECT_EQ(smoother.AddFix(drive.log.fixes.front()), FixOutcome::kLate);
  EXPECT_EQ(other.AddFix(drive.log.fixes.front()), FixOutcome::kAccepted);
}

TEST(FixedLagSmootherTest, AJumpOfTheOdometryDoesNotSpoilWhatIsKnownOfTheCamera) {
  const auto drive = DriveSimulator(DriveWithOffsetCamera(0.15), 1).Run();
  FixedLagSmoother smoother(ConfigOfOffsetCamera());
  Drive(drive, smoother);
  const double before = smoother.systematic_errors().camera_time_s();
  OdometryStep jump = drive.log.odometry.back();
  Fix fix = drive.log.fixes.back();
  for (const double length : {1e3, 1e7, 1e150}) {
    jump.time += milliseconds(50);
    jump.X_BprevB = Pose2(length, 0.0, 0.0);
    EXPECT_EQ(smoother.AddOdometry(jump).has_value(), length < 1e8);
    fix.time = jump.time;
    smoother.AddFix(fix);
    EXPECT_TRUE(smoother.systematic_errors().covariance.allFinite());
    EXPECT_TRUE(smoother.Estimate().X_WB.translation().allFinite());
  }
  EXPECT_NEAR(smoother.systematic_errors().camera_time_s(), before, 0.02);
}

TEST(FixedLagSmootherTest, SaysHowFarItKnowsItsPose) {
  const auto drive = DriveSimulator({}, 12).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  EXPECT_EQ(smoother.Estimate().status, SmootherStatus::kUninitialised);
  EXPECT_FALSE(smoother.Estimate().has_pose);
  ASSERT_TRUE(smoother.AddOdometry(drive.log.odometry.front()));
  smoother.AddFix(drive.log.fixes.front());
  EXPECT_EQ(smoother.Estimate().status, SmootherStatus::kUninitialised);
  EXPECT_TRUE(smoother.Estimate().has_pose);

  FixedLagSmoother driven{SmootherConfig()};
  const SmootherEstimate at_end = Drive(drive, driven);
  EXPECT_EQ(at_end.status, SmootherStatus::kOk);
  OdometryStep step = drive.log.odometry.back();
  for (int i = 0; i < 200; ++i) {
    step.time += milliseconds(50);
    ASSERT_TRUE(driven.AddOdometry(step));
  }
  const SmootherEstimate later = driven.Estimate();
  EXPECT_EQ(later.status, SmootherStatus::kDeadReckoning);
  EXPECT_NEAR(*later.time_since_fix_s, 10.95, 0.1);
  EXPECT_NEAR(later.distance_since_fix_m, 17.0, 1.5);
  EXPECT_GT(later.covariance(1, 1), at_end.covariance(1, 1));
}

double LargestErrorWhileOk(const std::vector<SmootherEstimate>& estimates,
                           const SimulatedDrive& drive) {
  double largest_m = 0.0;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    if (estimates[i].status != SmootherStatus::kOk) continue;
    largest_m = std::max(largest_m, PositionError(estimates[i].X_WB, drive.truth_at_fixes[i]));
  }
  return largest_m;
}

/// The first fixes are off together: the pose begins there, and does not say that it is sure of it.
TEST(FixedLagSmootherTest, IsNotOkBeforeItsPredictionsHoldAfterAPoorStart) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    for (const std::size_t poor : {1U, 2U, 4U}) {
      auto drive = DriveSimulator({.duration_s = 30.0, .fix_rate_hz = 5.0}, seed).Run();
      for (std::size_t i = 0; i < poor; ++i)
        drive.log.fixes[i].X_WB = Pose2(1.5, 1.2, 0.0) * drive.log.fixes[i].X_WB;
      const auto estimates = SmoothCausally(drive.log, SmootherConfig());
      EXPECT_LT(LargestErrorWhileOk(estimates, drive), 0.8)
          << seed << ": " << poor << " poor fixes";
      EXPECT_EQ(estimates.back().status, SmootherStatus::kOk);
      EXPECT_LT(PositionError(estimates[30].X_WB, drive.truth_at_fixes[30]), 0.5) << seed;
    }
  }
}

TEST(FixedLagSmootherTest, AResetIsAboutThisMoment) {
  const auto drive = DriveSimulator({}, 13).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  Drive(drive, smoother);
  const Pose2 X_WB(1.0, 2.0, 3.0);
  const Eigen::Matrix3d covariance = Eigen::Vector3d(0.04, 0.04, 0.01).asDiagonal();
  ASSERT_TRUE(smoother.Reset({.X_WB = X_WB, .covariance = covariance}));
  const SmootherEstimate estimate = smoother.Estimate();
  EXPECT_LT(PositionError(estimate.X_WB, X_WB), 1e-12);
  EXPECT_NEAR(estimate.covariance(0, 0), 0.04, 1e-5);
  OdometryStep step = drive.log.odometry.back();
  step.time += milliseconds(50);
  EXPECT_TRUE(smoother.AddOdometry(step));
}

/// As at first, though it has learned much and seen many fixes before.
TEST(FixedLagSmootherTest, ForgetsEverythingButItsCounts) {
  const auto drive = DriveSimulator({.duration_s = 400.0, .fix_rate_hz = 5.0}, 3).Run();
  FixedLagSmoother fresh{SmootherConfig()};
  FixedLagSmoother smoother{SmootherConfig()};
  Drive(drive, smoother);
  const std::int64_t accepted = smoother.counters().fixes_accepted;
  smoother.Forget();
  const auto next = DriveSimulator({.duration_s = 30.0, .fix_rate_hz = 5.0}, 4).Run();
  const SmootherEstimate expected = Drive(next, fresh);
  const SmootherEstimate estimate = Drive(next, smoother);
  EXPECT_EQ(estimate.X_WB.translation(), expected.X_WB.translation());
  EXPECT_EQ(estimate.covariance, expected.covariance);
  EXPECT_EQ(estimate.status, expected.status);
  EXPECT_EQ(smoother.counters().fixes_accepted, accepted + fresh.counters().fixes_accepted);
}

/// Who sets the pose may have put other wheels on: they are learned as fast as at first.
TEST(FixedLagSmootherTest, LearnsTheOdometrysErrorsQuicklyAfterAReset) {
  const auto drive = DriveSimulator({.duration_s = 400.0, .fix_rate_hz = 5.0}, 3).Run();
  FixedLagSmoother smoother{SmootherConfig()};
  Pose2 X_WB = Drive(drive, smoother).X_WB;
  ASSERT_TRUE(smoother.Reset({.X_WB = X_WB, .covariance = 0.01 * Eigen::Matrix3d::Identity()}));
  DriveSimulator simulator({}, 4);
  OdometryStep step = drive.log.odometry.back();
  step.X_BprevB = Pose2(0.3, 0.0, 0.0);
  SystematicVector before = smoother.systematic_errors().Sigmas();
  int changes = 0;
  for (int i = 0; i < 20; ++i) {
    step.time += milliseconds(200);
    ASSERT_TRUE(smoother.AddOdometry(step));
    X_WB = X_WB * step.X_BprevB;
    smoother.AddFix(simulator.MakeFix(step.time, X_WB));
    changes += smoother.systematic_errors().Sigmas() != before ? 1 : 0;
    before = smoother.systematic_errors().Sigmas();
  }
  EXPECT_GT(changes, 15);
}

/// Which it takes for wheels of another size, until they no longer spin.
TEST(FixedLagSmootherTest, ForgetsWheelsThatSpunForLong) {
  SmootherConfig config;
  config.window_keyframes = 10;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    auto drive = DriveSimulator({.duration_s = 120.0, .fix_rate_hz = 5.0}, seed).Run();
    const MonotonicTime begin = drive.log.odometry.front().time;
    for (OdometryStep& step : drive.log.odometry) {
      const Pose2& motion = step.X_BprevB;
      if (step.time - begin > seconds(60)) continue;
      step.X_BprevB = Pose2(1.5 * motion.x(), 1.5 * motion.y(), motion.yaw());
    }
    FixedLagSmoother smoother(config);
    const SmootherEstimate estimate = Drive(drive, smoother);
    EXPECT_LT(std::abs(smoother.systematic_errors().odometry_scale()), 0.05) << seed;
    EXPECT_LT(PositionError(estimate.X_WB, drive.X_WB_end), 0.6) << seed;
  }
}

TEST(SmoothAllTest, FindsTheCamerasOffset) {
  const auto drive = DriveSimulator(DriveWithOffsetCamera(0.15), 2).Run();
  SystematicErrors causal;
  SystematicErrors smoothed;
  SmoothCausally(drive.log, ConfigOfOffsetCamera(), &causal);
  SmoothAll(drive.log, ConfigOfOffsetCamera(), &smoothed);
  const SystematicVector sigmas = smoothed.Sigmas();
  EXPECT_LT(sigmas.x(), 0.006);
  EXPECT_LT(sigmas.y(), 0.03);
  EXPECT_NEAR(smoothed.camera_yaw_rad(), 0.0175, 3.0 * sigmas.x());
  EXPECT_NEAR(smoothed.camera_time_s(), 0.08, 3.0 * sigmas.y());
  EXPECT_NEAR(causal.camera_time_s(), smoothed.camera_time_s(), 2.0 * sigmas.y());
}

TEST(SmoothAllTest, BeatsTheCausalEstimate) {
  std::vector<double> causal;
  std::vector<double> smoothed;
  for (unsigned seed = 0; seed < (kIsSlowBuild ? 1U : 5U); ++seed) {
    const auto drive = DriveSimulator({.outlier_share = 0.2}, seed).Run();
    const auto before = SmoothCausally(drive.log, SmootherConfig());
    const auto after = SmoothAll(drive.log, SmootherConfig());
    for (std::size_t i = 30; i < before.size(); ++i) {
      causal.push_back(PositionError(before[i].X_WB, drive.truth_at_fixes[i]));
      smoothed.push_back(PositionError(after[i].X_WB, drive.truth_at_fixes[i]));
    }
  }
  EXPECT_LT(Summarize(smoothed).rmse, 0.8 * Summarize(causal).rmse);
}

}  // namespace
}  // namespace relocd
