#include "rendering/rgba_image.h"

#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "support/random.h"

namespace relocd {
namespace {

RgbaImage Uniform(int width, int height, std::array<std::uint8_t, 4> pixel) {
  RgbaImage image{.width = width, .height = height, .pixels = {}};
  for (int i = 0; i < width * height; ++i) {
    image.pixels.insert(image.pixels.end(), pixel.begin(), pixel.end());
  }
  return image;
}

TEST(ResampleToPowersOfTwo, ChoosesTheNearestSidesAndKeepsAUniformColour) {
  const std::array<std::array<int, 4>, 7> cases{{{1, 1, 1, 1},
                                                 {3, 5, 4, 4},
                                                 {100, 90, 128, 64},
                                                 {95, 97, 64, 128},
                                                 {64, 3, 64, 4},
                                                 {300, 2, 256, 2},
                                                 {700, 8, 256, 8}}};
  for (const auto& [width, height, new_width, new_height] : cases) {
    const RgbaImage image = ResampleToPowersOfTwo(Uniform(width, height, {10, 200, 33, 177}), 256);
    EXPECT_EQ(image.width, new_width);
    EXPECT_EQ(image.height, new_height);
    EXPECT_EQ(image.pixels, Uniform(new_width, new_height, {10, 200, 33, 177}).pixels);
  }
}

TEST(ResampleToPowersOfTwo, LeavesPowersOfTwoAsTheyAre) {
  TestRandom random(1);
  RgbaImage image = Uniform(16, 8, {0, 0, 0, 0});
  for (auto& value : image.pixels) {
    value = static_cast<std::uint8_t>(random.Integer(0, 255));
  }
  const auto pixels = image.pixels;
  EXPECT_EQ(ResampleToPowersOfTwo(std::move(image), 4096).pixels, pixels);
}

TEST(ResampleToPowersOfTwo, KeepsARampARamp) {
  constexpr int kWidth = 200;
  RgbaImage ramp{.width = kWidth, .height = 1, .pixels = {}};
  for (int x = 0; x < kWidth; ++x) {
    const auto value = static_cast<std::uint8_t>(x);
    ramp.pixels.insert(ramp.pixels.end(), {value, value, value, 255});
  }
  for (const int max_side : {64, 256}) {
    const RgbaImage image = ResampleToPowersOfTwo(ramp, max_side);
    ASSERT_EQ(image.width, max_side);
    const double scale = static_cast<double>(kWidth) / image.width;
    for (int x = 4; x < image.width - 4; ++x) {
      EXPECT_NEAR(image.pixels[static_cast<std::size_t>(4 * x)], (x + 0.5) * scale - 0.5, 0.6);
    }
  }
}

TEST(ResampleToPowersOfTwo, DoesNotMixTheColourOfWhatIsNotThere) {
  // Leaves of one green between holes of magenta.
  RgbaImage image{.width = 24, .height = 1, .pixels = {}};
  for (int x = 0; x < image.width; ++x) {
    const bool is_leaf = x % 3 == 0;
    const std::array<std::uint8_t, 4> leaf{20, 120, 30, 255};
    const std::array<std::uint8_t, 4> hole{255, 0, 255, 0};
    const auto& pixel = is_leaf ? leaf : hole;
    image.pixels.insert(image.pixels.end(), pixel.begin(), pixel.end());
  }
  const RgbaImage small = ResampleToPowersOfTwo(image, 8);
  for (std::size_t i = 0; i < small.pixels.size(); i += 4) {
    ASSERT_GT(small.pixels[i + 3], 0);
    EXPECT_EQ(small.pixels[i], 20);
    EXPECT_EQ(small.pixels[i + 1], 120);
    EXPECT_EQ(small.pixels[i + 2], 30);
  }
}

TEST(CheckRgbaSize, RefusesEmptyAndHuge) {
  EXPECT_TRUE(CheckRgbaSize(1, 1));
  EXPECT_TRUE(CheckRgbaSize(8192, 3000));
  EXPECT_FALSE(CheckRgbaSize(0, 5));
  EXPECT_FALSE(CheckRgbaSize(5, -1));
  EXPECT_FALSE(CheckRgbaSize(8193, 1));
  EXPECT_FALSE(CheckRgbaSize(8192, 8192));
  EXPECT_FALSE(CheckRgbaSize(std::int64_t{1} << 62, std::int64_t{1} << 62));
}

}  // namespace
}  // namespace relocd
