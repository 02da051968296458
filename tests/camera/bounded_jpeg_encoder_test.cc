#include "camera/bounded_jpeg_encoder.h"

#include <iterator>
#include <random>

#include <gtest/gtest.h>

#include "support/test_images.h"

namespace relocd {
namespace {

/// Noise, which JPEG cannot make small.
GrayImage MakeNoise(int width, int height) {
  std::mt19937 engine(11);
  GrayImage image{.width = width, .height = height, .pixels = {}};
  for (int i = 0; i < width * height; ++i)
    image.pixels.push_back(static_cast<std::uint8_t>(engine() & 0xFFU));
  return image;
}

TEST(BoundedJpegEncoderTest, KeepsTheQualityWhileImagesAreSmall) {
  BoundedJpegEncoder encoder(85, 60'000);
  const auto jpeg = encoder.Encode(MakeTestImage(320, 240));
  ASSERT_TRUE(jpeg);
  EXPECT_EQ(*jpeg, MakeTestJpeg(320, 240, 85));
  EXPECT_EQ(encoder.quality(), 85);
}

TEST(BoundedJpegEncoderTest, LowersTheQualityUntilAnImageFits) {
  BoundedJpegEncoder encoder(95, 40'000);
  const GrayImage noise = MakeNoise(320, 240);
  ASSERT_GT(EncodeGrayToJpeg(noise, 95)->size(), 40'000U);
  const auto jpeg = encoder.Encode(noise);
  ASSERT_TRUE(jpeg);
  EXPECT_LE(jpeg->size(), 40'000U);
  EXPECT_LT(encoder.quality(), 95);
}

TEST(BoundedJpegEncoderTest, RaisesTheQualityAgainWhenThereIsRoom) {
  BoundedJpegEncoder encoder(95, 40'000);
  ASSERT_TRUE(encoder.Encode(MakeNoise(320, 240)));
  const int lowered = encoder.quality();
  ASSERT_TRUE(encoder.Encode(MakeTestImage(320, 240)));
  EXPECT_EQ(encoder.quality(), lowered + 1);
  for (int i = 0; i < 100; ++i)
    ASSERT_TRUE(encoder.Encode(MakeTestImage(320, 240)));
  EXPECT_EQ(encoder.quality(), 95);
}

TEST(BoundedJpegEncoderTest, GivesWhatItHasWhenNoQualityFits) {
  BoundedJpegEncoder encoder(95, 1000);
  const auto jpeg = encoder.Encode(MakeNoise(320, 240));
  ASSERT_TRUE(jpeg);
  EXPECT_GT(jpeg->size(), 1000U);
  EXPECT_EQ(encoder.quality(), 10);
}

TEST(BoundedJpegEncoderTest, PassesErrorsOn) {
  BoundedJpegEncoder encoder(80, 60'000);
  EXPECT_FALSE(encoder.Encode(YuyvView{{}, 16, 16, 32}));
}

}  // namespace
}  // namespace relocd
