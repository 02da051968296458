#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

#include <gtest/gtest.h>

#include "smoothing/fixed_lag_smoother.h"
#include "smoothing/offline_smoother.h"
#include "smoothing/simulated_drive.h"
#include "support/error_statistics.h"
#include "support/slow_build.h"

namespace relocd {
namespace {

using std::chrono::seconds;

constexpr unsigned kSeeds = kIsSlowBuild ? 1 : 6;
constexpr MonotonicTime kBegin(seconds(1000));

/// A car with a camera every 0.2 s, a fifth of whose fixes are wrong.
DriveOptions Car(bool has_heading) {
  return {.duration_s = 100.0,
          .fix_rate_hz = 5.0,
          .speed_mps = 8.0,
          .fix_sigma_m = 0.5,
          .outlier_share = 0.2,
          .has_heading = has_heading,
          .noise = {.forward_sigma_m_per_sqrt_m = 0.005,
                    .sideways_sigma_m_per_sqrt_m = 0.005,
                    .position_sigma_m_per_sqrt_s = 0.002}};
}

/// A drive by its seed, with or without headings.
struct DriveCase {
  bool has_heading = false;
  unsigned seed = 0;

  [[nodiscard]] SimulatedDrive Run() const { return DriveSimulator(Car(has_heading), seed).Run(); }
};

std::vector<DriveCase> AllCases() {
  std::vector<DriveCase> cases;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    cases.push_back({.has_heading = true, .seed = seed});
    cases.push_back({.has_heading = false, .seed = seed});
  }
  return cases;
}

/// How a drive was followed: the errors at all fixes, and what the smoother counted.
struct Followed {
  std::vector<SmootherEstimate> estimates;
  std::vector<double> errors_m;
  SmootherCounters counters;

  [[nodiscard]] double LargestAfter(Duration time) const {
    double largest_m = 0.0;
    for (std::size_t i = 0; i < estimates.size(); ++i) {
      if (estimates[i].time >= kBegin + time) largest_m = std::max(largest_m, errors_m[i]);
    }
    return largest_m;
  }
};

Followed Follow(const SimulatedDrive& drive, const SmootherConfig& config = {}) {
  Followed followed;
  FixedLagSmoother smoother(config);
  std::size_t step = 0;
  for (std::size_t i = 0; i < drive.log.fixes.size(); ++i) {
    const Fix& fix = drive.log.fixes[i];
    for (; step < drive.log.odometry.size() && drive.log.odometry[step].time <= fix.time; ++step)
      EXPECT_TRUE(smoother.AddOdometry(drive.log.odometry[step]));
    smoother.AddFix(fix);
    followed.estimates.push_back(smoother.Estimate());
    followed.errors_m.push_back(
        (smoother.Estimate().X_WB.translation() - drive.truth_at_fixes[i].translation()).norm());
  }
  followed.counters = smoother.counters();
  return followed;
}

/// Changes the odometry of [40 s, 40 s + duration).
void ChangeOdometry(Duration duration, Pose2 (*change)(const Pose2&), SimulatedDrive& drive) {
  for (OdometryStep& step : drive.log.odometry) {
    const Duration time = step.time - kBegin - seconds(40);
    if (time >= Duration(0) && time < duration) step.X_BprevB = change(step.X_BprevB);
  }
}

Pose2 Spinning(const Pose2& motion) {
  return {2.0 * motion.x(), 2.0 * motion.y(), motion.yaw()};
}

Pose2 Skidding(const Pose2& motion) {
  return {0.4 * motion.x(), 0.4 * motion.y(), motion.yaw()};
}

Pose2 SkiddingOnOneSide(const Pose2& motion) {
  return {motion.x(), motion.y(), motion.yaw() + 0.025};
}

Pose2 WithAFlatTyre(const Pose2& motion) {
  return {motion.x(), motion.y(), motion.yaw() + 0.004};
}

void ExpectToBeFoundAfterASlip(Pose2 (*slip)(const Pose2&)) {
  for (const DriveCase& drive_case : AllCases()) {
    auto drive = drive_case.Run();
    ChangeOdometry(seconds(2), slip, drive);
    const Followed followed = Follow(drive);
    EXPECT_GT(followed.LargestAfter(seconds(41)), 5.0) << drive_case.seed;
    EXPECT_LT(followed.LargestAfter(seconds(45)), 2.5) << drive_case.seed;
    EXPECT_EQ(followed.counters.relocalizations, 1) << drive_case.seed;
    EXPECT_EQ(followed.estimates.back().status, SmootherStatus::kOk) << drive_case.seed;
  }
}

TEST(RecoveryTest, FindsThePoseWithinSecondsAfterWheelsSpun) {
  ExpectToBeFoundAfterASlip(Spinning);
}

TEST(RecoveryTest, FindsThePoseWithinSecondsAfterWheelsSkidded) {
  ExpectToBeFoundAfterASlip(Skidding);
}

TEST(RecoveryTest, FindsThePoseWithinSecondsAfterOneWheelSkidded) {
  ExpectToBeFoundAfterASlip(SkiddingOnOneSide);
}

TEST(RecoveryTest, SmoothsOverASlip) {
  for (const DriveCase& drive_case : AllCases()) {
    auto drive = drive_case.Run();
    ChangeOdometry(seconds(2), Spinning, drive);
    const auto estimates = SmoothAll(drive.log, SmootherConfig());
    for (std::size_t i = 0; i < estimates.size(); ++i) {
      const Eigen::Vector2d& truth = drive.truth_at_fixes[i].translation();
      EXPECT_LT((estimates[i].X_WB.translation() - truth).norm(), 2.5)
          << drive_case.seed << ": " << ToSeconds(estimates[i].time - kBegin) << " s";
    }
  }
}

TEST(RecoveryTest, DoesNotFollowAPlaceThatLooksAlikeForSomeSeconds) {
  for (const DriveCase& drive_case : AllCases()) {
    auto drive = drive_case.Run();
    for (Fix& fix : drive.log.fixes) {
      const Duration time = fix.time - kBegin;
      if (time < seconds(40) || time >= seconds(48)) continue;
      fix.X_WB = Pose2(fix.X_WB.x() + 14.0, fix.X_WB.y() + 14.0, fix.X_WB.yaw());
    }
    const Followed followed = Follow(drive);
    EXPECT_EQ(followed.counters.relocalizations, 0) << drive_case.seed;
    EXPECT_LT(followed.LargestAfter(seconds(10)), 5.0) << drive_case.seed;
  }
}

/// Without the fixes of [40 s, 70 s).
SimulatedDrive WithAGap(const SimulatedDrive& whole) {
  SimulatedDrive drive = whole;
  drive.log.fixes.clear();
  drive.truth_at_fixes.clear();
  for (std::size_t i = 0; i < whole.log.fixes.size(); ++i) {
    const Duration time = whole.log.fixes[i].time - kBegin;
    if (time >= seconds(40) && time < seconds(70)) continue;
    drive.log.fixes.push_back(whole.log.fixes[i]);
    drive.truth_at_fixes.push_back(whole.truth_at_fixes[i]);
  }
  return drive;
}

TEST(RecoveryTest, FixesThatComeBackAreBelievedWithinSeconds) {
  for (const DriveCase& drive_case : AllCases()) {
    auto drive = WithAGap(drive_case.Run());
    ChangeOdometry(seconds(30), WithAFlatTyre, drive);
    const Followed followed = Follow(drive);
    EXPECT_GT(followed.LargestAfter(seconds(69)), 8.0) << drive_case.seed;
    EXPECT_LT(followed.LargestAfter(seconds(73)), 2.5) << drive_case.seed;
  }
}

/// A camera that says five times too little of its errors is followed as one that says the truth.
TEST(RecoveryTest, FixesThatClaimTooMuchAreTakenAsTheyScatter) {
  for (const bool has_heading : {false, true}) {
    std::vector<double> claimed;
    std::vector<double> honest;
    for (unsigned seed = 0; seed < 5; ++seed) {
      auto drive = DriveSimulator({.duration_s = 100.0,
                                   .fix_rate_hz = 5.0,
                                   .speed_mps = 6.0,
                                   .fix_sigma_m = 0.5,
                                   .outlier_share = 0.2,
                                   .has_heading = has_heading},
                                  seed)
                       .Run();
      const auto errors_after_start = [&drive](std::vector<double>& errors) {
        const Followed followed = Follow(drive);
        for (std::size_t i = 100; i < followed.errors_m.size(); ++i) {
          EXPECT_TRUE(followed.estimates[i].has_pose) << i;
          EXPECT_NE(followed.estimates[i].status, SmootherStatus::kLost) << i;
          errors.push_back(followed.errors_m[i]);
        }
      };
      errors_after_start(honest);
      for (Fix& fix : drive.log.fixes)
        fix.covariance *= 0.04;
      errors_after_start(claimed);
    }
    EXPECT_LT(Summarize(claimed).rmse, 1.2 * Summarize(honest).rmse) << has_heading;
  }
}

}  // namespace
}  // namespace relocd
