#include "camera/jpeg.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.h"
#include "support/test_images.h"

namespace relocd {
namespace {

using testing::HasSubstr;

int WorstDifference(const GrayImage& a, const GrayImage& b) {
  int worst = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    worst = std::max(worst, std::abs(a.pixels[i] - b.pixels[i]));
  }
  return worst;
}

TEST(JpegTest, DecodingUndoesEncodingForAnySize) {
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {16, 16}, {97, 61}, {640, 480}}) {
    const GrayImage image = MakeTestImage(width, height);
    const auto jpeg = EncodeGrayToJpeg(image, 95);
    ASSERT_TRUE(jpeg) << jpeg.error().message;
    EXPECT_TRUE(FindWholeJpeg(*jpeg));
    EXPECT_EQ(ReadJpegSize(*jpeg).value(), (JpegSize{width, height}));
    const auto decoded = DecodeJpegToGray(*jpeg);
    ASSERT_TRUE(decoded) << decoded.error().message;
    ASSERT_EQ(decoded->pixels.size(), image.pixels.size());
    EXPECT_LE(WorstDifference(image, *decoded), 6) << width << " x " << height;
  }
}

TEST(JpegTest, YuyvKeepsItsBrightness) {
  const GrayImage image = MakeTestImage(98, 41);
  const int bytes_per_line = 2 * image.width + 12;  // drivers pad their lines
  std::vector<std::uint8_t> yuyv(static_cast<std::size_t>(bytes_per_line * image.height), 128);
  for (int v = 0; v < image.height; ++v) {
    for (int u = 0; u < image.width; ++u) {
      yuyv[static_cast<std::size_t>(v * bytes_per_line + 2 * u)] =
          image.Row(v)[static_cast<std::size_t>(u)];
    }
  }
  const auto jpeg = EncodeYuyvToJpeg({yuyv, image.width, image.height, bytes_per_line}, 95);
  ASSERT_TRUE(jpeg) << jpeg.error().message;
  const auto decoded = DecodeJpegToGray(*jpeg);
  ASSERT_TRUE(decoded) << decoded.error().message;
  ASSERT_EQ(decoded->pixels.size(), image.pixels.size());
  EXPECT_LE(WorstDifference(image, *decoded), 6);
}

TEST(JpegTest, RgbKeepsItsBrightness) {
  RgbImage image{.width = 64, .height = 32, .pixels = {}};
  for (int v = 0; v < image.height; ++v) {
    for (int u = 0; u < image.width; ++u) {
      for (const int value : {4 * u, 255 - 4 * u, 7 * v})
        image.pixels.push_back(static_cast<std::uint8_t>(value));
    }
  }
  const auto jpeg = EncodeRgbToJpeg(image, 95);
  ASSERT_TRUE(jpeg) << jpeg.error().message;
  const auto decoded = DecodeJpegToGray(*jpeg);
  ASSERT_TRUE(decoded);
  for (std::size_t i = 0; i < decoded->pixels.size(); ++i) {
    // ITU-R BT.601, which JPEG takes.
    const double brightness = 0.299 * image.pixels[3 * i] + 0.587 * image.pixels[3 * i + 1] +
                              0.114 * image.pixels[3 * i + 2];
    ASSERT_NEAR(decoded->pixels[i], brightness, 4.0) << i;
  }
  image.pixels.pop_back();
  EXPECT_EQ(EncodeRgbToJpeg(image, 95).error().message,
            "encoding JPEG: 6143 bytes for 64 x 32 px, must be 6144");
}

TEST(JpegTest, YuyvSurvivesBothWays) {
  const GrayImage image = MakeTestImage(64, 48);
  const auto yuyv = DecodeJpegToYuyv(EncodeGrayToJpeg(image, 98).value());
  ASSERT_TRUE(yuyv) << yuyv.error().message;
  const auto jpeg =
      EncodeYuyvToJpeg({.bytes = *yuyv, .width = 64, .height = 48, .bytes_per_line = 128}, 98);
  ASSERT_TRUE(jpeg);
  EXPECT_LE(WorstDifference(*DecodeJpegToGray(*jpeg), image), 5);
  EXPECT_EQ((*yuyv)[1], 128);  // gray has no colour
  EXPECT_EQ(DecodeJpegToYuyv(MakeTestJpeg(63, 48)).error().message,
            "decoding JPEG to YUYV: the width is 63 px, must be even");
}

TEST(JpegTest, LowerQualityIsSmaller) {
  EXPECT_LT(MakeTestJpeg(320, 240, 20).size(), MakeTestJpeg(320, 240, 95).size());
}

TEST(JpegTest, RefusesWhatCannotBeEncoded) {
  EXPECT_EQ(EncodeGrayToJpeg(MakeTestImage(8, 8), 0).error().message,
            "encoding JPEG: the quality is 0, must be in [1, 100]");
  EXPECT_EQ(EncodeGrayToJpeg({.width = 8, .height = 8, .pixels = {1, 2}}, 80).error().message,
            "encoding JPEG: 2 bytes for 8 x 8 px, must be 64");
  EXPECT_EQ(EncodeGrayToJpeg({.width = 0, .height = 8, .pixels = {}}, 80).error().message,
            "encoding JPEG: the image is 0 x 8 px, must have sides in [1, 8192] and at most "
            "32000000 pixels");
  const std::vector<std::uint8_t> bytes(64);
  EXPECT_EQ(EncodeYuyvToJpeg({bytes, 7, 4, 16}, 80).error().message,
            "encoding YUYV to JPEG: the width is 7 px with 16 bytes a line, must be even with at "
            "least 2 bytes a pixel");
  EXPECT_EQ(EncodeYuyvToJpeg({bytes, 8, 5, 16}, 80).error().message,
            "encoding YUYV to JPEG: 64 bytes for 8 x 5 px, must be 80");
}

TEST(JpegTest, FindsTheJpegInAPaddedBuffer) {
  const auto jpeg = MakeTestJpeg(32, 24);
  auto padded = jpeg;
  padded.resize(padded.size() + 1000);
  const auto found = FindWholeJpeg(padded);
  ASSERT_TRUE(found);
  EXPECT_TRUE(std::ranges::equal(*found, jpeg));
}

TEST(JpegTest, AJpegWithoutStartOrEndIsNotWhole) {
  const auto jpeg = MakeTestJpeg(32, 24);
  EXPECT_FALSE(FindWholeJpeg(std::span(jpeg).subspan(1)));
  EXPECT_FALSE(FindWholeJpeg(std::span(jpeg).first(jpeg.size() - 1)));
  EXPECT_FALSE(FindWholeJpeg(std::span(jpeg).first(2)));
  EXPECT_FALSE(FindWholeJpeg({}));
  EXPECT_FALSE(FindWholeJpeg(std::vector<std::uint8_t>(100)));
}

TEST(JpegTest, RefusesBytesThatAreNoJpeg) {
  const auto size = ReadJpegSize(AsBytes("this is text"));
  ASSERT_FALSE(size);
  EXPECT_EQ(size.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(size.error().message, HasSubstr("decoding JPEG: 12 bytes are no JPEG"));
  EXPECT_FALSE(DecodeJpegToGray({}));
  EXPECT_FALSE(ReadJpegSize({}));
}

TEST(JpegTest, RefusesAJpegThatWasCutShort) {
  const auto jpeg = MakeTestJpeg(320, 240);
  const auto decoded = DecodeJpegToGray(std::span(jpeg).first(jpeg.size() / 2));
  ASSERT_FALSE(decoded);
  EXPECT_THAT(decoded.error().message, HasSubstr("320 x 240 px are damaged (Premature end"));
}

TEST(JpegTest, RefusesASizeAboveTheLimitBeforeAllocating) {
  auto jpeg = MakeTestJpeg(32, 24);
  const std::array<std::uint8_t, 2> frame_marker{0xFF, 0xC0};
  const auto frame = std::ranges::search(jpeg, frame_marker).begin();
  ASSERT_NE(frame, jpeg.end());
  std::fill_n(frame + 5, 4, std::uint8_t{0x70});
  const auto decoded = DecodeJpegToGray(jpeg);
  ASSERT_FALSE(decoded);
  EXPECT_THAT(decoded.error().message, HasSubstr("the image is 28784 x 28784 px, must have sides"));
}

TEST(JpegTest, DecodesMotionJpegWithoutHuffmanTables) {
  auto jpeg = MakeTestJpeg(64, 48);
  const auto whole = DecodeJpegToGray(jpeg);
  const std::array<std::uint8_t, 2> table_marker{0xFF, 0xC4};
  int removed = 0;
  for (auto at = std::ranges::search(jpeg, table_marker); !at.empty();
       at = std::ranges::search(jpeg, table_marker)) {
    const int length = 2 + at.begin()[2] * 256 + at.begin()[3];
    jpeg.erase(at.begin(), at.begin() + length);
    ++removed;
  }
  ASSERT_GT(removed, 0);
  const auto decoded = DecodeJpegToGray(jpeg);
  ASSERT_TRUE(decoded) << decoded.error().message;
  EXPECT_EQ(decoded->pixels, whole->pixels);
}

TEST(JpegTest, SurvivesMutatedBytes) {
  const auto original = MakeTestJpeg(64, 48);
  std::mt19937 engine(5);  // the same mutations in every run
  std::uniform_int_distribution<int> byte(0, 255);
  int decoded = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    auto jpeg = original;
    std::uniform_int_distribution<std::size_t> position(0, jpeg.size() - 1);
    for (int change = 0; change <= trial % 8; ++change) {
      jpeg[position(engine)] = static_cast<std::uint8_t>(byte(engine));
    }
    if (trial % 5 == 0) jpeg.resize(position(engine));
    const auto image = DecodeJpegToGray(jpeg);
    if (!image) continue;
    ++decoded;
    ASSERT_EQ(std::ssize(image->pixels), std::int64_t{image->width} * image->height);
  }
  EXPECT_GT(decoded, 0);  // flipped coefficients still make a picture
  EXPECT_LT(decoded, 3000);
}

TEST(JpegTest, AFileErrorNamesTheFile) {
  const TemporaryFolder folder;
  const std::string path = folder.Write("a.jpg", "no jpeg");
  const auto image = ReadGrayImage(path);
  ASSERT_FALSE(image);
  EXPECT_THAT(image.error().message, testing::StartsWith(path + ": decoding JPEG: 7 bytes are no"));
  EXPECT_EQ(ReadGrayImage(folder.path() + "/none.jpg").error().kind, ErrorKind::kUnavailable);
}

}  // namespace
}  // namespace relocd
