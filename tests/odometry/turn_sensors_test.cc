#include "odometry/turn_sensors.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "support/random.h"

namespace relocd {
namespace {

MonotonicTime At(double seconds) {
  return MonotonicTime(FromSeconds(seconds));
}

YawRateSensor Sensor(const YawRateConfig& config, double resolution_radps = 0.0) {
  return {config, resolution_radps, std::chrono::milliseconds(200)};
}

TEST(YawRateSensorTest, IntegratesBetweenTheWheelsTimes) {
  YawRateSensor sensor = Sensor({.scale = 1.1, .bias_radps = 0.02});
  EXPECT_FALSE(sensor.TurnTo(At(0.0)));
  double sum_rad = 0.0;
  for (int i = 0; i <= 1000; ++i) {
    const double time_s = 0.01 * i;
    sensor.Add(At(time_s), 0.02 + 0.3 * std::sin(time_s) / 1.1);
    // The wheels are measured between the rates.
    const auto turn = sensor.TurnTo(At(time_s + 0.004));
    if (turn) sum_rad += turn->turn_rad;
  }
  EXPECT_NEAR(sum_rad, 0.3 * (std::cos(0.004) - std::cos(10.004)), 2e-4);
}

TEST(YawRateSensorTest, HasNoTurnWhileRatesAreMissing) {
  YawRateSensor sensor = Sensor({});
  EXPECT_FALSE(sensor.TurnTo(At(0.0)));
  sensor.Add(At(0.0), 0.1);
  EXPECT_FALSE(sensor.TurnTo(At(0.1)));  // there was no rate at its begin
  EXPECT_TRUE(sensor.TurnTo(At(0.15)));
  EXPECT_FALSE(sensor.TurnTo(At(0.3)));
  sensor.Add(At(0.5), 0.1);
  EXPECT_FALSE(sensor.TurnTo(At(0.5)));
  const auto turn = sensor.TurnTo(At(0.6));
  ASSERT_TRUE(turn);
  EXPECT_NEAR(turn->turn_rad, 0.01, 1e-12);
}

TEST(YawRateSensorTest, LearnsItsBiasWhileTheWheelsStand) {
  YawRateConfig config{.bias_sigma_radps = 0.05, .noise_rad_per_sqrt_s = 0.001};
  TestRandom random(5);
  for (int run = 0; run < 20; ++run) {
    YawRateSensor sensor = Sensor(config);
    const double bias_radps = random.Normal(0.05);
    sensor.TurnTo(At(0.0));
    for (int i = 0; i < 500; ++i) {
      sensor.Add(At(0.01 * i), bias_radps + random.Normal(config.noise_rad_per_sqrt_s / 0.1));
      sensor.TurnTo(At(0.01 * i + 0.001));
      sensor.LearnBias();
    }
    const double sigma_radps = std::sqrt(sensor.bias_variance());
    EXPECT_NEAR(sensor.bias_radps(), bias_radps, 4.0 * sigma_radps);
    EXPECT_LT(sigma_radps, 0.001);
  }
}

TEST(YawRateSensorTest, DoesNotBelieveABiasBelowItsResolution) {
  YawRateSensor sensor = Sensor({.noise_rad_per_sqrt_s = 1e-5}, 0.004);
  sensor.TurnTo(At(0.0));
  for (int i = 0; i < 500; ++i) {
    sensor.Add(At(0.01 * i), 0.008);
    sensor.TurnTo(At(0.01 * i + 0.001));
    sensor.LearnBias();
  }
  EXPECT_NEAR(sensor.bias_radps(), 0.008, 1e-5);
  EXPECT_GE(std::sqrt(sensor.bias_variance()), 0.99 * 0.004 / std::sqrt(12.0));
}

TEST(TurnSensorConfigTest, AcceptDefaultsAndNameWhatIsWrong) {
  const auto error_of = [](const auto& config) {
    const auto valid = config.Validate();
    return valid ? std::string() : valid.error().message;
  };
  EXPECT_EQ(error_of(SteeringConfig{}), "");
  EXPECT_EQ(error_of(YawRateConfig{}), "");
  EXPECT_EQ(error_of(SteeringConfig{.ratio = 0.0}), "ratio is 0, must be positive and finite");
  EXPECT_EQ(error_of(SteeringConfig{.fraction_signal = "A.B"}),
            "fraction_signal is 'A.B', must be empty without a signal");
  EXPECT_EQ(error_of(YawRateConfig{.scale = std::nan("")}),
            "scale is nan, must be positive and finite");
}

TEST(SteeringConfigTest, GivesTheWheelsAngle) {
  const SteeringConfig config{.unit_rad = 0.5, .ratio = 10.0, .offset_rad = 0.2};
  EXPECT_DOUBLE_EQ(config.WheelAngle(2.0), 0.08);
}

}  // namespace
}  // namespace relocd
