#include "rendering/texture.h"

#include <cstdint>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/random.h"

namespace relocd {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes Repeat(const Bytes& texel, int count) {
  Bytes all;
  for (int i = 0; i < count; ++i)
    all.insert(all.end(), texel.begin(), texel.end());
  return all;
}

/// Black and white texels in turn.
Texture Checkerboard(int side) {
  Bytes rgba;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const std::uint8_t value = (x + y) % 2 == 0 ? 0 : 255;
      rgba.insert(rgba.end(), {value, value, value, 255});
    }
  }
  return Texture::Create(side, side, rgba).value();
}

TEST(TextureTest, AnEvenTextureIsEvenAtEveryPlaceAndScale) {
  const Texture texture = Texture::Create(8, 4, Repeat({10, 128, 250, 77}, 32)).value();
  TestRandom random(1);
  for (int draw = 0; draw < 1000; ++draw) {
    const auto u = static_cast<float>(random.Uniform(-5.0, 5.0));
    const auto v = static_cast<float>(random.Uniform(-5.0, 5.0));
    const auto footprint = static_cast<float>(random.Uniform(0.0, 3.0));
    const Eigen::Array4f value = texture.Sample(u, v, footprint);
    constexpr float kTolerance = 0.004F;  // of the polynomial, and of rounding in the pyramid
    EXPECT_NEAR(value[0], LinearFromSrgb(10), kTolerance);
    EXPECT_NEAR(value[1], LinearFromSrgb(128), kTolerance);
    EXPECT_NEAR(value[2], LinearFromSrgb(250), kTolerance);
    EXPECT_NEAR(value[3], 77.0F / 255.0F, 1e-5F);
    EXPECT_NEAR(texture.SampleAlpha(u, v, footprint), 77.0F / 255.0F, 1e-5F);
  }
}

TEST(TextureTest, RepeatsInBothDirections) {
  const Texture texture = Checkerboard(8);
  TestRandom random(2);
  for (int draw = 0; draw < 1000; ++draw) {
    const auto u = static_cast<float>(random.Uniform(0.0, 1.0));
    const auto v = static_cast<float>(random.Uniform(0.0, 1.0));
    EXPECT_NEAR(texture.Sample(u, v, 0.0F)[0], texture.Sample(u - 3.0F, v + 2.0F, 0.0F)[0], 1e-4F);
  }
}

TEST(TextureTest, HasItsTexelsInTheMiddleOfTheirSquares) {
  const Texture texture = Checkerboard(8);
  EXPECT_NEAR(texture.Sample(0.5F / 8.0F, 0.5F / 8.0F, 0.0F)[0], 0.0F, 1e-6F);
  EXPECT_NEAR(texture.Sample(1.5F / 8.0F, 0.5F / 8.0F, 0.0F)[0], 1.0F, 1e-6F);
  EXPECT_NEAR(texture.Sample(1.5F / 8.0F, 1.5F / 8.0F, 0.0F)[0], 0.0F, 1e-6F);
}

TEST(TextureTest, FarAwayACheckerboardShinesHalfAsBrightAsWhite) {
  const Texture texture = Checkerboard(64);
  for (const float footprint : {0.05F, 0.3F, 1.0F, 20.0F}) {
    EXPECT_NEAR(texture.Sample(0.3F, 0.7F, footprint)[1], 0.5F, 0.01F) << footprint;
  }
}

TEST(TextureTest, ColourThatCoversNothingDoesNotShowFromFar) {
  Bytes rgba;
  for (int i = 0; i < 16; ++i) {
    const Bytes texel = i % 2 == 0 ? Bytes{200, 0, 0, 255} : Bytes{0, 255, 0, 0};
    rgba.insert(rgba.end(), texel.begin(), texel.end());
  }
  const Texture texture = Texture::Create(4, 4, rgba).value();
  const Eigen::Array4f value = texture.Sample(0.5F, 0.5F, 1.0F);
  EXPECT_NEAR(value[0], LinearFromSrgb(200), 0.01F);
  EXPECT_NEAR(value[1], 0.0F, 0.01F);
  EXPECT_NEAR(value[3], 0.5F, 0.01F);
  EXPECT_FALSE(texture.is_opaque());
}

TEST(TextureTest, SrgbAndLinearLightAreInverse) {
  for (int i = 0; i < 256; ++i)
    EXPECT_NEAR(SrgbFromLinear(LinearFromSrgb(static_cast<std::uint8_t>(i))), i, 0.01F);
}

TEST(TextureTest, RefusesSidesThatAreNoPowerOfTwo) {
  const auto refused = Texture::Create(48, 16, Bytes(4 * 48 * 16));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message,
              testing::HasSubstr("texture of 48 x 16, both must be powers of two up to 4096"));
  EXPECT_FALSE(Texture::Create(0, 16, Bytes{}));
  EXPECT_FALSE(Texture::Create(8192, 1, Bytes(4 * 8192)));
  EXPECT_THAT(Texture::Create(2, 2, Bytes(15)).error().message,
              testing::HasSubstr("has 15 bytes, must have 16"));
}

}  // namespace
}  // namespace relocd
