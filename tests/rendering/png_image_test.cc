#include "rendering/png_image.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include "camera/jpeg.h"
#include "support/mutate_bytes.h"
#include "support/random.h"

namespace relocd {
namespace {

using ::testing::HasSubstr;

std::string WritePng(int width, int height, png_uint_32 format, const std::string& pixels) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(width);
  png.height = static_cast<png_uint_32>(height);
  png.format = format;
  std::string bytes(100'000, '\0');
  png_alloc_size_t size = bytes.size();
  EXPECT_NE(png_image_write_to_memory(&png, bytes.data(), &size, 0, pixels.data(), 0, nullptr), 0);
  bytes.resize(size);
  return bytes;
}

std::string RandomBytes(TestRandom& random, int count) {
  std::string bytes;
  for (int i = 0; i < count; ++i) {
    bytes += static_cast<char>(random.Integer(0, 255));
  }
  return bytes;
}

std::string AsText(const RgbaImage& image) {
  return {image.pixels.begin(), image.pixels.end()};
}

TEST(ReadPngImage, GivesPixelsWithTheirCoverage) {
  TestRandom random(1);
  for (int trial = 0; trial < 50; ++trial) {
    const int width = random.Integer(1, 30);
    const int height = random.Integer(1, 30);
    const std::string pixels = RandomBytes(random, 4 * width * height);
    const std::string png = WritePng(width, height, PNG_FORMAT_RGBA, pixels);
    const auto image = ReadPngImage(AsBytes(png));
    ASSERT_TRUE(image) << image.error().message;
    EXPECT_EQ(image->width, width);
    EXPECT_EQ(image->height, height);
    EXPECT_EQ(AsText(*image), pixels);
  }
}

TEST(ReadPngImage, CoversAllWhereTheFileHasNoCoverage) {
  const std::string gray = WritePng(2, 1, PNG_FORMAT_GRAY, "\x10\xf0");
  const auto image = ReadPngImage(AsBytes(gray));
  ASSERT_TRUE(image);
  EXPECT_EQ(AsText(*image), "\x10\x10\x10\xff\xf0\xf0\xf0\xff");
}

TEST(ReadPngImage, RefusesWhatIsCutShortAnywhere) {
  TestRandom random(2);
  const std::string pixels = RandomBytes(random, 4 * 8 * 8);
  const std::string png = WritePng(8, 8, PNG_FORMAT_RGBA, pixels);
  constexpr std::size_t kEndMarker = 12;
  for (std::size_t size = 0; size < png.size(); ++size) {
    const auto image = ReadPngImage(AsBytes(std::string_view(png).substr(0, size)));
    if (image) {
      EXPECT_GE(size, png.size() - kEndMarker - 4);
      EXPECT_EQ(AsText(*image), pixels);
    } else {
      EXPECT_THAT(image.error().message, HasSubstr("PNG image: ")) << size;
    }
  }
}

TEST(ReadPngImage, RefusesAnImageAboveTheLimitsBeforeItIsDecoded) {
  std::string png = WritePng(9000, 1, PNG_FORMAT_GRAY, std::string(9000, 'x'));
  const auto image = ReadPngImage(AsBytes(png));
  ASSERT_FALSE(image);
  EXPECT_THAT(image.error().message, HasSubstr("PNG image: image of 9000 x 1 px, sides must be"));
}

TEST(ReadPngImage, SurvivesAnyBytes) {
  TestRandom random(3);
  const std::string png = WritePng(8, 8, PNG_FORMAT_RGBA, RandomBytes(random, 4 * 8 * 8));
  for (int trial = 0; trial < 10'000; ++trial) {
    const auto image = ReadPngImage(AsBytes(MutateBytes(png, random)));
    if (!image) continue;
    EXPECT_EQ(image->pixels.size(), static_cast<std::size_t>(4 * image->width * image->height));
  }
}

}  // namespace
}  // namespace relocd
