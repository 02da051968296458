#include "features/gradient_histograms.h"

#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "features/texture.h"

namespace relocd {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr std::size_t kAll = 100'000;

GradientHistogramsConfig TestConfig() {
  GradientHistogramsConfig config;
  config.image_width = kWidth;
  config.image_height = kHeight;
  config.working_width = kWidth;
  config.working_height = kHeight;
  config.octaves = 3;
  return config;
}

std::unique_ptr<GradientHistograms> TestExtractor() {
  return GradientHistograms::Create(TestConfig()).value();
}

/// Mean squared difference of two cells' features, leaving the octaves' energies out.
double Difference(const CellFeatures& a,
                  std::size_t cell_a,
                  const CellFeatures& b,
                  std::size_t cell_b) {
  const auto dimension = static_cast<std::size_t>(a.dimension);
  double sum = 0.0;
  for (std::size_t i = 0; i < dimension; ++i) {
    const double difference = a.values[cell_a * dimension + i] - b.values[cell_b * dimension + i];
    sum += difference * difference;
  }
  return sum / 3.0;  // each octave's part has length one
}

TEST(GradientHistogramsTest, GivesEachCellAPartOfLengthOneForEachOctave) {
  const auto extractor = TestExtractor();
  CellFeatures features;
  ASSERT_TRUE(extractor->Extract(Texture(1).Image(kWidth, kHeight), kAll, features));
  // 17 points of 8 orientations, and of 4 in the third octave.
  EXPECT_EQ(extractor->dimension(), 136 + 136 + 68);
  EXPECT_EQ(features.size(), 40U * 30U);
  std::size_t begin = 0;
  for (const std::size_t size : {136U, 136U, 68U}) {
    double squares = 0.0;
    for (std::size_t i = begin; i < begin + size; ++i)
      squares += std::pow(features.values[i], 2);
    EXPECT_NEAR(squares, 1.0, 0.05);  // less by the part that stands for noise
    begin += size;
  }
}

TEST(GradientHistogramsTest, WhichSideIsBrighterCountsInFineOctavesOnly) {
  const auto extractor = TestExtractor();
  GrayImage image = Texture(6).Image(kWidth, kHeight);
  CellFeatures features;
  ASSERT_TRUE(extractor->Extract(image, kAll, features));
  for (std::uint8_t& pixel : image.pixels)
    pixel = static_cast<std::uint8_t>(255 - pixel);
  CellFeatures inverted;
  ASSERT_TRUE(extractor->Extract(image, kAll, inverted));
  const auto dimension = static_cast<std::size_t>(features.dimension);
  double fine = 0.0;
  double coarse = 0.0;
  for (std::size_t i = 0; i < features.values.size(); ++i) {
    const double difference = std::abs(features.values[i] - inverted.values[i]);
    (i % dimension < 272 ? fine : coarse) += difference;
  }
  EXPECT_LT(coarse, 1e-3 * fine);
}

TEST(GradientHistogramsTest, TheNumberOfThreadsDoesNotChangeTheFeatures) {
  const GrayImage image = Texture(4).Image(kWidth, kHeight);
  CellFeatures one;
  ASSERT_TRUE(TestExtractor()->Extract(image, 300, one));
  CellFeatures three;
  ASSERT_TRUE(GradientHistograms::Create(TestConfig(), std::make_shared<ThreadTeam>(3))
                  .value()
                  ->Extract(image, 300, three));
  EXPECT_EQ(one.values, three.values);
  EXPECT_EQ(one.pixels, three.pixels);
}

TEST(GradientHistogramsTest, ContrastCancels) {
  const auto extractor = TestExtractor();
  const GrayImage image = Texture(2).Image(kWidth, kHeight);
  GrayImage faint = image;
  for (std::uint8_t& pixel : faint.pixels) {
    pixel = static_cast<std::uint8_t>(40 + pixel / 2);
  }
  CellFeatures features;
  CellFeatures faint_features;
  ASSERT_TRUE(extractor->Extract(image, kAll, features));
  ASSERT_TRUE(extractor->Extract(faint, kAll, faint_features));
  double same = 0.0;
  double other = 0.0;
  for (std::size_t cell = 0; cell + 7 < features.size(); ++cell) {
    same += Difference(features, cell, faint_features, cell);
    other += Difference(features, cell, faint_features, cell + 7);
  }
  EXPECT_LT(same, 0.02 * other);
}

TEST(GradientHistogramsTest, FeaturesMoveWithTheImage) {
  const auto extractor = TestExtractor();
  const Texture texture(3);
  CellFeatures features;
  CellFeatures moved;
  ASSERT_TRUE(extractor->Extract(texture.Image(kWidth, kHeight), kAll, features));
  ASSERT_TRUE(extractor->Extract(texture.Image(kWidth, kHeight, 16.0, 8.0), kAll, moved));
  constexpr std::size_t kColumns = 40;
  for (std::size_t row = 10; row < 18; ++row) {
    for (std::size_t column = 10; column < 28; ++column) {
      EXPECT_LT(
          Difference(features, (row + 1) * kColumns + column + 2, moved, row * kColumns + column),
          1e-4);
    }
  }
}

TEST(GradientHistogramsTest, ChoosesCellsWithTexture) {
  const auto extractor = TestExtractor();
  GrayImage image = Texture(4).Image(kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth / 2; ++u) {
      image.pixels[static_cast<std::size_t>(v * kWidth + u)] = 90;
    }
  }
  CellFeatures features;
  ASSERT_TRUE(extractor->Extract(image, 300, features));
  ASSERT_EQ(features.size(), 300U);
  for (const Eigen::Vector2f& pixel : features.pixels) {
    EXPECT_GT(pixel.x(), kWidth / 2.0F - 12.0F);
  }
}

TEST(GradientHistogramsTest, ChosenCellsAreSpreadOverTheImage) {
  const auto extractor = TestExtractor();
  CellFeatures features;
  ASSERT_TRUE(extractor->Extract(Texture(5).Image(kWidth, kHeight), 400, features));
  std::map<std::pair<int, int>, int> tiles;
  for (const Eigen::Vector2f& pixel : features.pixels) {
    ++tiles[{static_cast<int>(pixel.x()) / 64, static_cast<int>(pixel.y()) / 64}];
  }
  EXPECT_GE(tiles.size(), 15U);
  for (const auto& [tile, count] : tiles) {
    EXPECT_LE(count, 50);  // 2.5 times the even share of 20 tiles
  }
}

TEST(GradientHistogramsTest, SmallImagesAreEnlargedAndLargeOnesReduced) {
  const GradientHistogramsConfig small = GradientHistogramsForImage(416, 128);
  EXPECT_EQ(small.working_width, 1040);
  EXPECT_EQ(small.working_height, 320);
  const GradientHistogramsConfig vga = GradientHistogramsForImage(640, 480);
  EXPECT_EQ(vga.working_width, 640);
  const GradientHistogramsConfig large = GradientHistogramsForImage(1920, 1080);
  EXPECT_LT(large.working_width, 800);
  for (const auto& config : {small, vga, large}) {
    EXPECT_TRUE(Validate(config));
  }
}

TEST(GradientHistogramsTest, PixelsSurviveTheWayToTheWorkingImageAndBack) {
  auto config = TestConfig();
  config.working_width = 800;
  config.working_height = 600;
  const auto extractor = GradientHistograms::Create(config).value();
  const Eigen::Vector2f pixel(17.25F, 101.5F);
  EXPECT_LT((extractor->FromWorking(extractor->ToWorking(pixel)) - pixel).norm(), 1e-4F);
  // The image's corner, half a pixel before the first centre, stays the corner.
  EXPECT_LT((extractor->ToWorking({-0.5F, -0.5F}) - Eigen::Vector2f(-0.5F, -0.5F)).norm(), 1e-5F);
}

TEST(GradientHistogramsTest, RefusesAnImageOfAnotherSize) {
  CellFeatures features;
  const auto result = TestExtractor()->Extract(Texture(6).Image(64, 64), kAll, features);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, "image is 64 x 64 pixels, must be 320 x 240 as in the map");
}

TEST(GradientHistogramsTest, RefusesAConfigurationOutOfRange) {
  auto config = TestConfig();
  config.octaves = 9;
  const auto extractor = GradientHistograms::Create(config);
  ASSERT_FALSE(extractor);
  EXPECT_THAT(extractor.error().message, HasSubstr("features.octaves is 9, must be in [1, 5]"));
}

}  // namespace
}  // namespace relocd
