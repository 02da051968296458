#include "features/gradient_maps.h"

#include <array>
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "features/texture.h"

namespace relocd {
namespace {

using Histogram = std::array<float, GradientMaps::kDescriptorSize>;

constexpr int kSide = 161;  // turned about its centre, even pixels stay even: the grid's places

std::vector<float> Floats(const GrayImage& image) {
  return {image.pixels.begin(), image.pixels.end()};
}

Histogram SampleAt(const GradientMaps& maps, int octave, float x, float y) {
  Histogram histogram{};
  maps.Sample(octave, x, y, histogram);
  return histogram;
}

TEST(GradientMapsTest, TurningTheImageTurnsTheRingsAndTheOrientations) {
  const Texture texture(1);
  const GrayImage image = texture.Image(kSide, kSide);
  // A quarter turn: what was to the right is below.
  GrayImage turned = image;
  for (int v = 0; v < kSide; ++v) {
    for (int u = 0; u < kSide; ++u) {
      turned.pixels[static_cast<std::size_t>(u * kSide + (kSide - 1 - v))] =
          image.pixels[static_cast<std::size_t>(v * kSide + u)];
    }
  }
  ThreadTeam team(1);
  GradientMaps maps;
  maps.Compute(Floats(image), kSide, kSide, 1, team);
  GradientMaps turned_maps;
  turned_maps.Compute(Floats(turned), kSide, kSide, 1, team);
  const Histogram before = SampleAt(maps, 0, 80.0F, 60.0F);
  const Histogram after = SampleAt(turned_maps, 0, 100.0F, 80.0F);
  double worst = 0.0;
  double scale = 0.0;
  for (int point = 0; point < GradientMaps::kPoints; ++point) {
    const int ring = point == 0 ? 0 : (point - 1) / 8;
    const int turned_point = point == 0 ? 0 : 1 + 8 * ring + ((point - 1) % 8 + 2) % 8;
    for (int bin = 0; bin < 8; ++bin) {
      const float a = before[static_cast<std::size_t>(point * 8 + bin)];
      const float b = after[static_cast<std::size_t>(turned_point * 8 + (bin + 2) % 8)];
      worst = std::max(worst, static_cast<double>(std::abs(a - b)));
      scale = std::max(scale, static_cast<double>(a));
    }
  }
  EXPECT_LT(worst, 1e-4 * scale);
}

TEST(GradientMapsTest, IgnoresAConstant) {
  const GrayImage image = Texture(2).Image(kSide, kSide);
  std::vector<float> pixels = Floats(image);
  ThreadTeam team(1);
  GradientMaps maps;
  maps.Compute(pixels, kSide, kSide, 3, team);
  const Histogram before = SampleAt(maps, 2, 80.0F, 80.0F);
  for (float& pixel : pixels) {
    pixel += 64.0F;  // exact in float
  }
  maps.Compute(pixels, kSide, kSide, 3, team);
  const Histogram after = SampleAt(maps, 2, 80.0F, 80.0F);
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_NEAR(before[i], after[i], 1e-2F);
  }
}

TEST(GradientMapsTest, SeesARampInOneDirection) {
  std::vector<float> pixels(static_cast<std::size_t>(kSide) * kSide);
  for (int v = 0; v < kSide; ++v) {
    for (int u = 0; u < kSide; ++u) {
      pixels[static_cast<std::size_t>(v * kSide + u)] = static_cast<float>(u);
    }
  }
  ThreadTeam team(1);
  GradientMaps maps;
  maps.Compute(pixels, kSide, kSide, 1, team);
  const Histogram histogram = SampleAt(maps, 0, 80.0F, 80.0F);
  // Sobel's operator gives 8 for a slope of 1; the diagonals see it by cos(45 degrees).
  EXPECT_NEAR(histogram[0], 8.0F, 1e-3F);
  EXPECT_NEAR(histogram[1], 8.0F * std::sqrt(0.5F), 1e-3F);
  EXPECT_NEAR(histogram[2], 0.0F, 1e-3F);
  EXPECT_NEAR(histogram[4], 0.0F, 1e-3F);
  EXPECT_NEAR(histogram[7], 8.0F * std::sqrt(0.5F), 1e-3F);
}

TEST(GradientMapsTest, AffinityIsOneForThePlaceItself) {
  ThreadTeam team(1);
  GradientMaps maps;
  maps.Compute(Floats(Texture(3).Image(kSide, kSide)), kSide, kSide, 1, team);
  Histogram roots = SampleAt(maps, 0, 80.0F, 80.0F);
  float sum = 0.0F;
  for (const float value : roots) {
    sum += value;
  }
  for (float& value : roots) {
    value = std::sqrt(value / sum);
  }
  EXPECT_NEAR(maps.Affinity(0, 80.0F, 80.0F, roots), 1.0F, 1e-5F);
  EXPECT_LT(maps.Affinity(0, 110.0F, 60.0F, roots), 0.98F);
}

}  // namespace
}  // namespace relocd
