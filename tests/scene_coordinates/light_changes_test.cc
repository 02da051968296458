#include "scene_coordinates/light_changes.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace relocd {
namespace {

constexpr int kWidth = 80;
constexpr int kHeight = 60;

/// A ramp of gray levels from left to right.
std::vector<float> Ramp() {
  std::vector<float> pixels;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u)
      pixels.push_back(20.0F + 2.0F * static_cast<float>(u));
  }
  return pixels;
}

LightChanges None() {
  return {.contrast = 1.0,
          .gamma = 1.0,
          .shading = 0.0,
          .shadows = 0,
          .haze = 0.0,
          .noise = 0.0,
          .occluders = 0};
}

std::vector<float> Changed(const LightChanges& changes, unsigned seed) {
  std::vector<float> pixels = Ramp();
  std::mt19937_64 engine(seed);
  ChangeLight(changes, engine, kWidth, kHeight, pixels);
  return pixels;
}

TEST(LightChangesTest, NoneChangesNothing) {
  const std::vector<float> before = Ramp();
  const std::vector<float> after = Changed(None(), 1);
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_NEAR(after[i], before[i], 1e-3);
}

TEST(LightChangesTest, TheSameSeedMakesTheSameChange) {
  EXPECT_EQ(Changed({}, 5), Changed({}, 5));
  EXPECT_NE(Changed({}, 5), Changed({}, 6));
}

TEST(LightChangesTest, ContrastAndGammaKeepTheOrderOfGrayLevels) {
  LightChanges changes = None();
  changes.contrast = 1.8;
  changes.gamma = 2.0;
  for (unsigned seed = 0; seed < 50; ++seed) {
    const std::vector<float> after = Changed(changes, seed);
    EXPECT_TRUE(std::is_sorted(after.begin(), after.begin() + kWidth)) << seed;
  }
}

TEST(LightChangesTest, ShadowsOnlyDarken) {
  LightChanges changes = None();
  changes.shadows = 3;
  const std::vector<float> before = Ramp();
  bool darkened = false;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const std::vector<float> after = Changed(changes, seed);
    for (std::size_t i = 0; i < before.size(); ++i) {
      EXPECT_LE(after[i], before[i] + 1e-3F);
      EXPECT_GE(after[i], 0.25F * 0.25F * 0.25F * before[i] - 1e-3F);
      darkened = darkened || after[i] < 0.9F * before[i];
    }
  }
  EXPECT_TRUE(darkened);
}

TEST(LightChangesTest, NoiseHasAtMostTheDeviationAskedFor) {
  LightChanges changes = None();
  changes.noise = 6.0;
  double largest = 0.0;
  for (unsigned seed = 0; seed < 50; ++seed) {
    const std::vector<float> before = Ramp();
    const std::vector<float> after = Changed(changes, seed);
    double squares = 0.0;
    for (std::size_t i = 0; i < before.size(); ++i)
      squares += std::pow(static_cast<double>(after[i] - before[i]), 2);
    largest = std::max(largest, std::sqrt(squares / static_cast<double>(before.size())));
  }
  EXPECT_GT(largest, 2.0);
  EXPECT_LT(largest, 6.3);
}

TEST(LightChangesTest, GivesFiniteNumbersForAnyImage) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    std::vector<float> pixels(static_cast<std::size_t>(kWidth * kHeight),
                              seed % 2 == 0 ? 0.0F : 255.0F);
    std::mt19937_64 engine(seed);
    ChangeLight({}, engine, kWidth, kHeight, pixels);
    EXPECT_TRUE(std::all_of(pixels.begin(), pixels.end(), [](float value) {
      return std::isfinite(value) && value > -60.0F && value < 320.0F;
    }));
  }
}

}  // namespace
}  // namespace relocd
