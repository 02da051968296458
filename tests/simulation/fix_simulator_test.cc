#include "simulation/fix_simulator.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geometry/angle.h"

namespace relocd {
namespace {

constexpr std::int64_t kPeriodNs = 100'000'000;

/// A drive at 10 Hz along x, that looks along y.
Trajectory2 Truth(int poses) {
  Trajectory2 X_WBs;
  for (int i = 0; i < poses; ++i) {
    X_WBs.push_back({.time_ns = 7 + i * kPeriodNs, .X_WB = Pose2(0.5 * i, -3.0, 1.5)});
  }
  return X_WBs;
}

/// One fix, beside the truth at its time.
struct Error {
  Eigen::Vector2d position_m;
  double heading_rad;
  bool is_outlier;
};

std::vector<Error> ErrorsOf(const Trajectory2& truth, const FixSimulationOptions& options) {
  const auto fixes = SimulateFixes(truth, options);
  EXPECT_TRUE(fixes);
  std::vector<Error> errors;
  for (const SimulatedFix& fix : *fixes) {
    const Pose2& X_WB = truth[static_cast<std::size_t>((fix.time_ns - 7) / kPeriodNs)].X_WB;
    errors.push_back({.position_m = fix.X_WB.translation() - X_WB.translation(),
                      .heading_rad = WrapAngle(fix.X_WB.yaw() - X_WB.yaw()),
                      .is_outlier = fix.is_outlier});
  }
  return errors;
}

/// The mean of x_i x_(i + lag), of both coordinates.
double Correlation(const std::vector<Error>& errors, std::size_t lag) {
  double sum = 0.0;
  for (std::size_t i = 0; i + lag < errors.size(); ++i)
    sum += errors[i].position_m.dot(errors[i + lag].position_m);
  return sum / (2.0 * static_cast<double>(errors.size() - lag));
}

TEST(FixSimulatorTest, ErrsByItsSigmas) {
  const auto errors = ErrorsOf(
      Truth(20'000), {.seed = 3, .rate_hz = 10.0, .sigma_m = 0.5, .heading_sigma_rad = 0.02});
  ASSERT_EQ(errors.size(), 20'000U);
  EXPECT_NEAR(std::sqrt(Correlation(errors, 0)), 0.5, 0.01);
  EXPECT_NEAR(Correlation(errors, 1), 0.0, 0.01);  // each by itself
  double squares = 0.0;
  for (const Error& error : errors)
    squares += error.heading_rad * error.heading_rad;
  EXPECT_NEAR(std::sqrt(squares / 20'000.0), 0.02, 5e-4);
}

TEST(FixSimulatorTest, GivesFixesAtItsRateAndAtTheTrajectorysTimes) {
  const Trajectory2 truth = Truth(101);  // 10 s
  const auto fixes = SimulateFixes(truth, {.rate_hz = 4.0});
  ASSERT_TRUE(fixes);
  EXPECT_EQ(fixes->size(), 41U);
  for (const SimulatedFix& fix : *fixes)
    EXPECT_EQ((fix.time_ns - 7) % kPeriodNs, 0);
  EXPECT_EQ(SimulateFixes(truth, {.rate_hz = 1000.0}).value().size(), truth.size());
}

TEST(FixSimulatorTest, OutliersAreAsManyAsAskedForAndWithinReach) {
  const auto errors = ErrorsOf(
      Truth(20'000),
      {.seed = 4, .rate_hz = 10.0, .sigma_m = 0.1, .outlier_share = 0.3, .outlier_reach_m = 50.0});
  std::size_t outliers = 0;
  double furthest_m = 0.0;
  for (const Error& error : errors) {
    if (!error.is_outlier) {
      EXPECT_LT(error.position_m.norm(), 0.1 * 6.0);
      continue;
    }
    ++outliers;
    furthest_m = std::max(furthest_m, error.position_m.norm());
  }
  EXPECT_NEAR(static_cast<double>(outliers), 6000.0, 200.0);  // three sigma of the count
  EXPECT_GT(furthest_m, 49.0);
  EXPECT_LT(furthest_m, 50.0 + 0.1 * 6.0);
}

TEST(FixSimulatorTest, ABiasLastsAndFades) {
  const auto errors = ErrorsOf(Truth(100'000),
                               {.seed = 5,
                                .rate_hz = 10.0,
                                .sigma_m = 0.01,
                                .bias_sigma_m = 0.4,
                                .bias_correlation_s = 2.0});
  EXPECT_NEAR(std::sqrt(Correlation(errors, 0)), 0.4, 0.02);
  EXPECT_NEAR(Correlation(errors, 20) / Correlation(errors, 0), std::exp(-1.0), 0.05);
  EXPECT_NEAR(Correlation(errors, 200) / Correlation(errors, 0), 0.0, 0.05);
}

TEST(FixSimulatorTest, ATurnedAndLateCameraChangesHeadingsAndTimesAlone) {
  FixSimulationOptions options{.heading_sigma_rad = 0.01};
  const auto straight = SimulateFixes(Truth(50), options).value();
  options.mounting_yaw_rad = 0.1;
  options.time_offset_s = 0.08;
  const auto turned = SimulateFixes(Truth(50), options).value();
  ASSERT_EQ(turned.size(), straight.size());
  for (std::size_t i = 0; i < turned.size(); ++i) {
    EXPECT_EQ(turned[i].time_ns - straight[i].time_ns, 80'000'000);
    EXPECT_EQ(turned[i].X_WB.x(), straight[i].X_WB.x());
    EXPECT_NEAR(WrapAngle(turned[i].X_WB.yaw() - straight[i].X_WB.yaw()), 0.1, 1e-12);
  }
}

TEST(FixSimulatorTest, TheSeedDecidesAll) {
  const FixSimulationOptions options{.seed = 9, .outlier_share = 0.5, .bias_sigma_m = 1.0};
  FixSimulationOptions other = options;
  other.seed = 10;
  const auto first = SimulateFixes(Truth(50), options).value();
  const auto again = SimulateFixes(Truth(50), options).value();
  const auto another = SimulateFixes(Truth(50), other).value();
  ASSERT_EQ(first.size(), again.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].X_WB.x(), again[i].X_WB.x());
    EXPECT_EQ(first[i].is_outlier, again[i].is_outlier);
    EXPECT_NE(first[i].X_WB.x(), another[i].X_WB.x());
  }
}

TEST(FixSimulatorTest, RefusesOptionsOutOfRangeByName) {
  const auto error_of = [](const auto& change) {
    FixSimulationOptions options;
    change(options);
    const auto fixes = SimulateFixes(Truth(3), options);
    return fixes ? std::string() : fixes.error().message;
  };
  EXPECT_EQ(error_of([](FixSimulationOptions&) {}), "");
  EXPECT_EQ(error_of([](FixSimulationOptions& o) { o.rate_hz = 0.0; }),
            "rate_hz is 0, must be in [0.01, 1000]");
  EXPECT_EQ(error_of([](FixSimulationOptions& o) { o.outlier_share = 1.5; }),
            "outlier_share is 1.5, must be in [0, 1]");
  EXPECT_EQ(error_of([](FixSimulationOptions& o) {
              o.sigma_m = std::numeric_limits<double>::quiet_NaN();
            }),
            "sigma_m is nan, must be in [0.001, 1000]");
}

}  // namespace
}  // namespace relocd
