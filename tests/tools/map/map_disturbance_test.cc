#include "map_disturbance.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "features/texture.h"

namespace relocd {
namespace {

using testing::Each;
using testing::HasSubstr;

constexpr int kWidth = 128;
constexpr int kHeight = 96;

double Mean(const GrayImage& image) {
  return std::accumulate(image.pixels.begin(), image.pixels.end(), 0.0) /
         static_cast<double>(image.pixels.size());
}

/// Root mean square of the differences.
double Difference(const GrayImage& a, const GrayImage& b) {
  double squares = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const double difference = static_cast<double>(a.pixels[i]) - b.pixels[i];
    squares += difference * difference;
  }
  return std::sqrt(squares / static_cast<double>(a.pixels.size()));
}

TEST(MapDisturbanceTest, DoesWhatItsNameSays) {
  const GrayImage image = Texture(3).Image(kWidth, kHeight);
  EXPECT_EQ(Disturb(image, Disturbance::kNone, 1).pixels, image.pixels);
  EXPECT_NEAR(Mean(Disturb(image, Disturbance::kDark, 1)), 0.5 * Mean(image), 0.5);

  GrayImage gray = image;
  gray.pixels.assign(gray.pixels.size(), 128);
  EXPECT_THAT(Disturb(gray, Disturbance::kGamma, 1).pixels, Each(74)) << "255 (128/255)^1.8";
  EXPECT_THAT(Disturb(gray, Disturbance::kBlur, 1).pixels, Each(128));
  EXPECT_NEAR(Difference(Disturb(gray, Disturbance::kNoise, 1), gray), 12.0, 0.5);
  EXPECT_LT(Difference(Disturb(image, Disturbance::kBlur, 1), image), Difference(gray, image));

  const GrayImage covered = Disturb(image, Disturbance::kOccluders, 1);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (covered.pixels[i] != image.pixels[i]) ++changed;
  }
  const double one = 40.0 * 30.0;
  EXPECT_GT(static_cast<double>(changed), 0.9 * one);
  EXPECT_LE(static_cast<double>(changed), 4.0 * one);
}

TEST(MapDisturbanceTest, TheSeedDecides) {
  const GrayImage image = Texture(3).Image(kWidth, kHeight);
  for (const Disturbance disturbance : {Disturbance::kNoise, Disturbance::kOccluders}) {
    EXPECT_EQ(Disturb(image, disturbance, 1).pixels, Disturb(image, disturbance, 1).pixels);
    EXPECT_NE(Disturb(image, disturbance, 1).pixels, Disturb(image, disturbance, 2).pixels);
  }
}

/// Pixels of a row that are neither as dark as one side of an edge nor as bright as the other.
int EdgeWidth(int width, int height) {
  GrayImage edge{.width = width, .height = height, .pixels = {}};
  for (int pixel = 0; pixel < width * height; ++pixel)
    edge.pixels.push_back(pixel % width < width / 2 ? 0 : 250);
  const GrayImage blurred = Disturb(edge, Disturbance::kBlur, 1);
  return static_cast<int>(
      std::count_if(blurred.pixels.begin(), blurred.pixels.begin() + width, [](std::uint8_t value) {
        return value > 10 && value < 240;
      }));
}

TEST(MapDisturbanceTest, BlursInProportionToThePicturesSize) {
  EXPECT_NEAR(EdgeWidth(640, 480), 2.0 * 2.0 * 1.75, 1.0);  // 4 % and 96 % of a Gaussian
  EXPECT_NEAR(EdgeWidth(1280, 960), 2 * EdgeWidth(640, 480), 2);
}

TEST(MapDisturbanceTest, MirroredTwiceIsTheImage) {
  const GrayImage image = Texture(3).Image(kWidth, kHeight);
  EXPECT_EQ(Mirror(image).pixels[0], image.pixels[kWidth - 1]);
  EXPECT_EQ(Mirror(Mirror(image)).pixels, image.pixels);
}

TEST(MapDisturbanceTest, FitsTheMiddleOfAnotherCamerasImage) {
  GrayImage image{.width = 8, .height = 4, .pixels = {}};
  for (int v = 0; v < 4; ++v) {
    for (int u = 0; u < 8; ++u)
      image.pixels.push_back(static_cast<std::uint8_t>(u < 2 || u >= 6 ? 250 : 10 * v));
  }
  const GrayImage fitted = FitSize(image, 2, 2);
  EXPECT_EQ(fitted.width, 2);
  EXPECT_THAT(fitted.pixels, testing::ElementsAre(5, 5, 25, 25));
  EXPECT_EQ(FitSize(image, 8, 4).pixels, image.pixels);
}

TEST(MapDisturbanceTest, NamesWhatItKnows) {
  EXPECT_EQ(ParseDisturbance("blur").value(), Disturbance::kBlur);
  const auto unknown = ParseDisturbance("fog");
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().message,
              HasSubstr("--disturb is 'fog', must be one of none, gamma, dark, blur, noise, "));
}

}  // namespace
}  // namespace relocd
