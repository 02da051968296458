#include "odometry/differential_drive.h"

#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/covariance.h"
#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

/// Only the wheels' noise, so that numbers can be checked by hand.
DifferentialDriveConfig UnitDrive() {
  DifferentialDriveConfig config;
  config.track_m = 0.5;
  config.wheel_sigma_m_per_sqrt_m = 0.02;
  config.lateral_sigma_m_per_sqrt_m = 1e-12;
  config.turn_sigma_rad_per_sqrt_rad = 0.0;
  config.idle_sigma_m_per_sqrt_s = 1e-12;
  config.idle_sigma_rad_per_sqrt_s = 1e-12;
  return config;
}

TEST(MotionFromTravelTest, EqualTravelIsStraight) {
  const BodyMotion motion = MotionFromTravel(UnitDrive(), {.travel_m = {2.0, 2.0}});
  EXPECT_THAT(motion.X_BiBj.Log(), IsNear(Eigen::Vector3d(2.0, 0.0, 0.0), 1e-12));
}

TEST(MotionFromTravelTest, OppositeTravelTurnsOnTheSpotAndRightForwardTurnsLeft) {
  const BodyMotion motion = MotionFromTravel(UnitDrive(), {.travel_m = {-0.25, 0.25}});
  EXPECT_THAT(motion.X_BiBj.Log(), IsNear(Eigen::Vector3d(0.0, 0.0, 1.0), 1e-12));
}

TEST(MotionFromTravelTest, AQuarterTurnEndsWhereTheCircleDoes) {
  // The left wheel stands: the body's origin goes round it on a circle of half the track.
  const double quarter = 0.5 * std::numbers::pi;
  const BodyMotion motion = MotionFromTravel(UnitDrive(), {.travel_m = {0.0, 0.5 * quarter}});
  EXPECT_NEAR(motion.X_BiBj.x(), 0.25, 1e-12);
  EXPECT_NEAR(motion.X_BiBj.y(), 0.25, 1e-12);
  EXPECT_NEAR(motion.X_BiBj.yaw(), quarter, 1e-12);
}

TEST(MotionFromTravelTest, OneWheelsNoiseMovesForwardAndYawTogether) {
  // The right wheel goes a metre with 0.02 m of noise, and the arc is bent back by a tiny track.
  DifferentialDriveConfig config = UnitDrive();
  config.track_m = 1e6;
  const BodyMotion motion = MotionFromTravel(config, {.travel_m = {0.0, 1.0}});
  const double variance = 0.02 * 0.02;
  EXPECT_NEAR(motion.covariance(0, 0), 0.25 * variance, 1e-12);
  EXPECT_NEAR(motion.covariance(2, 2), variance * 1e-12, 1e-21);
  EXPECT_NEAR(motion.covariance(0, 2), 0.5 * variance * 1e-6, 1e-15);
}

TEST(MotionFromTravelTest, UncertaintyGrowsWithTravelTurnAndTime) {
  const DifferentialDriveConfig config;
  const auto covariance = [&](double left, double right, double duration_s) {
    const WheelTravel travel{.travel_m = {left, right}, .duration_s = duration_s};
    return MotionFromTravel(config, travel).covariance;
  };
  const Eigen::Matrix3d still = covariance(0.0, 0.0, 0.01);
  EXPECT_TRUE(IsCovariance(still));
  EXPECT_GT(covariance(0.0, 0.0, 0.02)(0, 0), still(0, 0));
  EXPECT_GT(covariance(0.1, 0.1, 0.01)(0, 0), still(0, 0));
  EXPECT_GT(covariance(0.2, 0.2, 0.01)(1, 1), covariance(0.1, 0.1, 0.01)(1, 1));
  EXPECT_GT(covariance(-0.1, 0.1, 0.01)(2, 2), covariance(0.1, 0.1, 0.01)(2, 2));
}

TEST(MotionFromTravelTest, GivesACovarianceForAnyTravel) {
  TestRandom random(1);
  for (int i = 0; i < 1000; ++i) {
    const WheelTravel travel{.travel_m = {random.Uniform(-3.0, 3.0), random.Uniform(-3.0, 3.0)},
                             .duration_s = random.Uniform(0.001, 1.0)};
    EXPECT_TRUE(IsCovariance(MotionFromTravel({}, travel).covariance));
  }
}

/// The motion's covariance is that of many motions of noisy wheels.
TEST(MotionFromTravelTest, AgreesWithManyNoisyArcs) {
  DifferentialDriveConfig config = UnitDrive();
  const WheelTravel travel{.travel_m = {0.4, 0.7}, .variance_m2 = {1e-4, 4e-4}};
  config.wheel_sigma_m_per_sqrt_m = 1e-6;
  const BodyMotion expected = MotionFromTravel(config, travel);
  std::mt19937 engine(2);
  std::normal_distribution<double> normal;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::Vector2d noise(0.01 * normal(engine), 0.02 * normal(engine));
    const Pose2 X_BiBj = Pose2::Exp(BodyTwist(config.track_m, travel.travel_m + noise));
    const Eigen::Vector3d error = (expected.X_BiBj.Inverse() * X_BiBj).Log();
    sum += error * error.transpose();
  }
  const Eigen::Matrix3d sampled = sum / kDraws;
  EXPECT_THAT(sampled, IsNear(expected.covariance, 0.03 * expected.covariance(2, 2)));
  EXPECT_NEAR(sampled(0, 0), expected.covariance(0, 0), 0.05 * expected.covariance(0, 0));
  EXPECT_NEAR(sampled(1, 1), expected.covariance(1, 1), 0.05 * expected.covariance(1, 1));
}

TEST(RightJacobianTest, AgreesWithDifferences) {
  TestRandom random(3);
  for (const double yaw : {0.0, 1e-12, 1e-6, 0.9e-4, 1.1e-4, 1e-2, 1.0, 3.0}) {
    const Eigen::Vector3d tangent(random.Uniform(-2.0, 2.0), random.Uniform(-2.0, 2.0), yaw);
    Eigen::Matrix3d expected;
    constexpr double kStep = 1e-6;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(k);
      const Pose2 before = Pose2::Exp(tangent - step);
      expected.col(k) = (before.Inverse() * Pose2::Exp(tangent + step)).Log() / (2.0 * kStep);
    }
    EXPECT_THAT(RightJacobian(tangent), IsNear(expected, 1e-6)) << yaw;
  }
}

TEST(DifferentialDriveConfigTest, AcceptsItsDefaults) {
  EXPECT_TRUE(DifferentialDriveConfig{}.Validate());
}

TEST(DifferentialDriveConfigTest, NamesTheFieldAndTheValue) {
  EXPECT_EQ(DifferentialDriveConfig{.left_radius_m = -0.1}.Validate().error().message,
            "left_radius_m is -0.1, must be positive and finite");
  EXPECT_EQ(DifferentialDriveConfig{.right_scale = 0.0}.Validate().error().message,
            "right_scale is 0, must be finite and not 0");
  EXPECT_EQ(DifferentialDriveConfig{.ticks_per_revolution = 0}.Validate().error().message,
            "ticks_per_revolution is 0, must be at least 1");
}

TEST(DifferentialDriveConfigTest, RejectsNaN) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(DifferentialDriveConfig{.track_m = nan}.Validate());
}

}  // namespace
}  // namespace relocd
