#include "rendering/camera_sensor.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rendering/texture.h"

namespace relocd {
namespace {

LinearImage Even(float radiance) {
  LinearImage image = LinearImage::Black(200, 150);
  for (Eigen::Array3f& pixel : image.pixels)
    pixel = Eigen::Array3f::Constant(radiance);
  return image;
}

struct Statistics {
  double mean = 0.0;
  double variance = 0.0;
};

Statistics StatisticsOf(const RgbImage& image) {
  Statistics statistics;
  for (const std::uint8_t value : image.pixels)
    statistics.mean += value;
  statistics.mean /= static_cast<double>(image.pixels.size());
  for (const std::uint8_t value : image.pixels)
    statistics.variance += (value - statistics.mean) * (value - statistics.mean);
  statistics.variance /= static_cast<double>(image.pixels.size());
  return statistics;
}

/// How steep sRGB is, in values of 8 bits for the whole range of linear light.
double SlopeOfSrgb(double linear) {
  constexpr double kStep = 1e-3;
  return (SrgbFromLinear(static_cast<float>(linear + kStep)) -
          SrgbFromLinear(static_cast<float>(linear - kStep))) /
         (2.0 * kStep);
}

TEST(CameraSensorTest, NoiseHasTheVarianceOfItsElectrons) {
  CameraSensorOptions options;
  options.vignetting = 0.0;
  for (const double read_noise : {0.0, 5.0, 12.0}) {
    options.read_noise_electrons = read_noise;
    const CameraSensor sensor(options);
    for (const double linear : {0.1, 0.2, 0.6}) {
      for (const double gain : {1.0, 8.0}) {
        const double electrons = linear * options.full_well_electrons / gain;
        const Exposure exposure{.time_s = 0.002, .gain = gain};
        const double radiance = electrons / (options.electrons_per_radiance_s * exposure.time_s);
        const Statistics seen =
            StatisticsOf(sensor.Develop(Even(static_cast<float>(radiance)), exposure, 5));
        const double scale = SlopeOfSrgb(linear) * gain / options.full_well_electrons;
        constexpr double kRounding = 1.0 / 12.0;
        const double expected = scale * scale * (electrons + read_noise * read_noise) + kRounding;
        EXPECT_NEAR(seen.mean, SrgbFromLinear(static_cast<float>(linear)), 1.0);
        EXPECT_NEAR(seen.variance / expected, 1.0, 0.06)
            << linear << " of white, gain " << gain << ", read noise " << read_noise;
      }
    }
  }
}

TEST(CameraSensorTest, CornersGetLessLight) {
  CameraSensorOptions options;
  options.vignetting = 0.4;
  const CameraSensor sensor(options);
  EXPECT_NEAR(sensor.VignettingAt(100, 75, 200, 150), 1.0F, 1e-3F);
  EXPECT_NEAR(sensor.VignettingAt(0, 0, 200, 150), 0.6F, 0.01F);
}

TEST(CameraSensorTest, TheSameSeedGivesTheSameNoise) {
  const CameraSensor sensor{CameraSensorOptions{}};
  const Exposure exposure{.time_s = 0.0005};
  const RgbImage first = sensor.Develop(Even(0.5F), exposure, 5);
  EXPECT_EQ(first.pixels, sensor.Develop(Even(0.5F), exposure, 5).pixels);
  EXPECT_NE(first.pixels, sensor.Develop(Even(0.5F), exposure, 6).pixels);
}

TEST(CameraSensorTest, WhatIsTooBrightIsWhite) {
  const CameraSensor sensor{CameraSensorOptions{}};
  EXPECT_EQ(StatisticsOf(sensor.Develop(Even(100.0F), {.time_s = 0.01}, 5)).mean, 255.0);
}

TEST(CameraSensorTest, RefusesOptionsOutOfRange) {
  CameraSensorOptions options;
  EXPECT_TRUE(options.Validate());
  options.vignetting = 1.0;
  EXPECT_THAT(options.Validate().error().message,
              testing::HasSubstr("vignetting is 1, must be in [0, 1)"));
  options = {};
  options.read_noise_electrons = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(options.Validate());
}

TEST(AutoExposureTest, ComesToItsTarget) {
  const CameraSensorOptions sensor;
  const AutoExposureOptions options;
  AutoExposure automatic(sensor, options);
  automatic.Next(Even(1.0F), 0.0);
  Exposure exposure;
  for (int i = 0; i < 40; ++i)
    exposure = automatic.Next(Even(0.3F), 0.1 * i);
  const double white = 0.3 * sensor.electrons_per_radiance_s * exposure.time_s * exposure.gain /
                       sensor.full_well_electrons;
  EXPECT_NEAR(white, options.target, 0.01 * options.target);
  EXPECT_EQ(exposure.gain, 1.0);
}

TEST(AutoExposureTest, TakesItsTimeFollowingTheLight) {
  AutoExposure automatic({}, {});
  const double before = automatic.Next(Even(1.0F), 0.0).time_s;
  const double next = automatic.Next(Even(0.25F), 0.1).time_s;
  EXPECT_GT(next, 1.2 * before);
  EXPECT_LT(next, 2.0 * before);
}

TEST(AutoExposureTest, RaisesTheGainOnlyWhenTheTimeIsAtItsLimit) {
  const AutoExposureOptions options;
  AutoExposure automatic({}, options);
  const Exposure dark = automatic.Next(Even(0.005F), 0.0);
  EXPECT_EQ(dark.time_s, options.max_time_s);
  EXPECT_GT(dark.gain, 3.0);
  EXPECT_LE(dark.gain, options.max_gain);
}

TEST(AutoExposureTest, HuntsByTheStopsAskedFor) {
  AutoExposureOptions options;
  options.hunting_stops = 1.0;
  AutoExposure automatic({}, options);
  double shortest = 1.0;
  double longest = 0.0;
  for (int i = 0; i < 80; ++i) {
    const double time_s = automatic.Next(Even(0.5F), 0.1 * i).time_s;
    shortest = std::min(shortest, time_s);
    longest = std::max(longest, time_s);
  }
  EXPECT_NEAR(std::log2(longest / shortest), 2.0, 0.05);
}

}  // namespace
}  // namespace relocd
