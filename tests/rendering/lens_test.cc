#include "rendering/lens.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace relocd {
namespace {

/// A bright upper and a dark lower half.
LinearImage Horizon() {
  LinearImage image = LinearImage::Black(160, 120);
  for (int v = 0; v < 60; ++v) {
    for (int u = 0; u < 160; ++u)
      image.At(u, v) = Eigen::Array3f::Ones();
  }
  return image;
}

std::size_t CountChanged(const LinearImage& a, const LinearImage& b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    count += (a.pixels[i] != b.pixels[i]).any() ? 1 : 0;
  return count;
}

LinearImage Through(const Lens& lens, double time_s, std::uint64_t frame_seed) {
  LinearImage image = Horizon();
  lens.Apply(image, time_s, frame_seed);
  return image;
}

TEST(LensTest, ACleanOneChangesNothing) {
  EXPECT_EQ(CountChanged(Through(Lens(160, 120, 0.0, 0.0, 1), 2.0, 3), Horizon()), 0U);
}

TEST(LensTest, DirtStaysWhereItIs) {
  const Lens lens(160, 120, 1.0, 0.0, 1);
  const LinearImage first = Through(lens, 0.0, 1);
  EXPECT_EQ(CountChanged(first, Through(lens, 9.0, 2)), 0U);
  EXPECT_GT(CountChanged(first, Horizon()), 100U);
  EXPECT_GT(CountChanged(first, Through(Lens(160, 120, 1.0, 0.0, 2), 0.0, 1)), 100U);
}

TEST(LensTest, StreaksAreOthersInEveryFrameAndDropsAreWipedAway) {
  const Lens lens(160, 120, 0.0, 1.0, 1);
  EXPECT_GT(CountChanged(Through(lens, 0.0, 1), Through(lens, 0.0, 2)), 50U);
  // Just before the wiper comes there are more drops than just after.
  const auto drops = [&](double time_s) {
    return CountChanged(Through(lens, time_s, 1), Through(lens, 0.0, 1));
  };
  EXPECT_GT(drops(5.9), 4 * (drops(6.1) + 10));
}

TEST(LensTest, NothingBecomesNegativeOrBrighterThanTwiceTheBrightest) {
  const LinearImage image = Through(Lens(160, 120, 1.0, 1.0, 3), 5.0, 7);
  for (const Eigen::Array3f& pixel : image.pixels) {
    EXPECT_GE(pixel.minCoeff(), 0.0F);
    EXPECT_LE(pixel.maxCoeff(), 2.0F);
  }
}

}  // namespace
}  // namespace relocd
