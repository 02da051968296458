#include "simulation/wheel_simulator.h"

#include <cmath>
#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/covariance.h"
#include "simulation/winding_drive.h"
#include "support/eigen_matchers.h"
#include "support/wheel_ticks_frame.h"

namespace relocd {
namespace {

OdometryConfig TicksVehicle() {
  OdometryConfig config;
  config.wheels.counter_signal = "WHEEL_TICKS.COUNTER";
  config.wheels.checksum_signal = "WHEEL_TICKS.CHECKSUM";
  config.wheels.checksum_rule = "crc8_j1850";
  config.drive.lateral_sigma_m_per_sqrt_m = 1e-4;
  config.drive.turn_sigma_rad_per_sqrt_rad = 0.0;
  return config;
}

constexpr const char* kSpeedsDbc =
    "BO_ 1 SPEEDS: 8 X\n"
    " SG_ LEFT : 7|16@0- (0.001,0) [0|0] \"m/s\" X\n"
    " SG_ RIGHT : 23|16@0- (0.001,0) [0|0] \"m/s\" X\n";

OdometryConfig SpeedVehicle() {
  OdometryConfig config = TicksVehicle();
  config.wheels = {};
  config.wheels.kind = "speed";
  config.wheels.left_signal = "SPEEDS.LEFT";
  config.wheels.right_signal = "SPEEDS.RIGHT";
  return config;
}

DbcFile Parse(const std::string& text) {
  return DbcFile::Parse(text, "v.dbc").value();
}

/// Where odometry takes a drive's frames to have ended, from where it began.
struct Estimate {
  Pose2 X_OB;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< Of its right perturbation.
  int increments = 0;
  int flagged = 0;
};

Estimate RunOdometry(const SimulatedDrive& drive,
                     const OdometryConfig& config,
                     const DbcFile& dbc) {
  WheelOdometry odometry = WheelOdometry::Create(config, dbc).value();
  Estimate estimate;
  for (const CandumpRecord& record : drive.frames) {
    const auto increment = odometry.Handle(record.frame);
    if (!increment) continue;
    ++estimate.increments;
    if ((increment->flags & ~kOdometryStandstill) != 0) ++estimate.flagged;
    const Eigen::Matrix3d adjoint = increment->X_BiBj.Inverse().Adjoint();
    estimate.covariance =
        adjoint * estimate.covariance * adjoint.transpose() + increment->covariance;
    estimate.X_OB = increment->X_OB;
  }
  return estimate;
}

Pose2 TrueMotion(const SimulatedDrive& drive) {
  return drive.X_WBs.front().X_WB.Inverse() * drive.X_WBs.back().X_WB;
}

class WheelSimulatorTest : public testing::TestWithParam<bool> {
 protected:
  const OdometryConfig config_ = GetParam() ? TicksVehicle() : SpeedVehicle();
  const DbcFile dbc_ = Parse(GetParam() ? kWheelTicksDbc : kSpeedsDbc);
  const Trajectory2 trajectory_ = WindingDrive();
};

TEST_P(WheelSimulatorTest, PerfectWheelsGiveTheDriveBack) {
  const auto drive =
      SimulateWheels(trajectory_, config_, dbc_, {.seed = 1, .wheel_sigma_m_per_sqrt_m = 0.0});
  ASSERT_TRUE(drive) << drive.error().message;
  const Estimate estimate = RunOdometry(*drive, config_, dbc_);
  EXPECT_EQ(estimate.increments, 2996);
  EXPECT_EQ(estimate.flagged, 0);
  const Eigen::Vector3d error = (TrueMotion(*drive).Inverse() * estimate.X_OB).Log();
  EXPECT_LT(error.head<2>().norm(), 0.05);
  EXPECT_LT(std::abs(error.z()), 0.01);
}

TEST_P(WheelSimulatorTest, TheSeedDecides) {
  const auto first = SimulateWheels(trajectory_, config_, dbc_, {.seed = 1});
  const auto again = SimulateWheels(trajectory_, config_, dbc_, {.seed = 1});
  const auto other = SimulateWheels(trajectory_, config_, dbc_, {.seed = 2});
  ASSERT_TRUE(first && again && other);
  int differing = 0;
  for (std::size_t i = 0; i < first->frames.size(); ++i) {
    ASSERT_EQ(FormatCandumpLine(first->frames[i]), FormatCandumpLine(again->frames[i]));
    differing += first->frames[i].frame.data == other->frames[i].frame.data ? 0 : 1;
  }
  EXPECT_GT(differing, 500);
}

/// The squared Mahalanobis distance of the pose at the end follows a chi-squared distribution of
/// three degrees of freedom: over 60 seeds its mean is 3 +- 0.32.
TEST_P(WheelSimulatorTest, OdometrysErrorIsAsLargeAsItSays) {
  constexpr int kSeeds = 60;
  double sum = 0.0;
  int inside = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const auto drive = SimulateWheels(trajectory_, config_, dbc_, {.seed = seed, .rate_hz = 25.0});
    ASSERT_TRUE(drive);
    const Estimate estimate = RunOdometry(*drive, config_, dbc_);
    const Eigen::Vector3d error = (estimate.X_OB.Inverse() * TrueMotion(*drive)).Log();
    const double squared = SquaredMahalanobis(error, estimate.covariance);
    sum += squared;
    inside += squared < kChiSquared95Dof3 ? 1 : 0;
  }
  EXPECT_GT(sum / kSeeds, 2.0);
  EXPECT_LT(sum / kSeeds, 4.0);
  EXPECT_GE(inside, 52);
}

INSTANTIATE_TEST_SUITE_P(Kinds, WheelSimulatorTest, testing::Bool(), [](const auto& instance) {
  return instance.param ? "Ticks" : "Speeds";
});

TEST(WheelSimulatorErrorsTest, RadiusErrorsScaleTheDistance) {
  // Only straight on: with both wheels off by different parts, the path is a wide arc.
  Trajectory2 X_WBs;
  for (int i = 0; i < 100; ++i)
    X_WBs.push_back({.time_ns = i * kWindingStepNs, .X_WB = Pose2(0.05 * i, 0.0, 0.0)});
  const OdometryConfig config = TicksVehicle();
  const DbcFile dbc = Parse(kWheelTicksDbc);
  const WheelSimulationOptions options{
      .seed = 3, .radius_sigma = 0.01, .wheel_sigma_m_per_sqrt_m = 0.0};
  const auto drive = SimulateWheels(X_WBs, config, dbc, options);
  ASSERT_TRUE(drive);
  const Estimate estimate = RunOdometry(*drive, config, dbc);
  EXPECT_GT(std::abs(estimate.X_OB.yaw()), 0.01);
  EXPECT_NEAR(estimate.X_OB.x(), 4.95, 0.15);
}

TEST(WheelSimulatorErrorsTest, SlipsMoveAWheelInVain) {
  const OdometryConfig config = TicksVehicle();
  const DbcFile dbc = Parse(kWheelTicksDbc);
  const Trajectory2 trajectory = WindingDrive();
  const WheelSimulationOptions options{
      .seed = 4, .wheel_sigma_m_per_sqrt_m = 0.0, .slips_per_m = 0.5, .slip_sigma_m = 0.1};
  const auto drive = SimulateWheels(trajectory, config, dbc, options);
  ASSERT_TRUE(drive);
  const Estimate estimate = RunOdometry(*drive, config, dbc);
  const Eigen::Vector3d error = (estimate.X_OB.Inverse() * TrueMotion(*drive)).Log();
  EXPECT_GT(std::abs(error.z()), 0.05);
  EXPECT_GT(estimate.flagged, 5);
}

TEST(WheelSimulatorErrorsTest, NamesWhatIsWrong) {
  const DbcFile dbc = Parse(kWheelTicksDbc);
  const auto error_of = [&](const Trajectory2& X_WBs, const WheelSimulationOptions& options) {
    const auto drive = SimulateWheels(X_WBs, TicksVehicle(), dbc, options);
    return drive ? "" : drive.error().message;
  };
  EXPECT_EQ(error_of({}, {}), "the trajectory has 0 poses, must have at least 2");
  EXPECT_EQ(error_of(WindingDrive(), {.rate_hz = 0.0}), "rate_hz is 0, must be in [1, 1000]");
}

TEST(WheelSimulatorErrorsTest, NamesASpeedThatTheSignalCannotHold) {
  Trajectory2 X_WBs;
  for (int i = 0; i < 10; ++i)
    X_WBs.push_back({.time_ns = i * kWindingStepNs, .X_WB = Pose2(5.0 * i, 0.0, 0.0)});  // 100 m/s
  const auto drive = SimulateWheels(X_WBs, SpeedVehicle(), Parse(kSpeedsDbc), {});
  ASSERT_FALSE(drive);
  EXPECT_THAT(drive.error().message, testing::StartsWith("signal LEFT cannot hold 100"));
}

}  // namespace
}  // namespace relocd
