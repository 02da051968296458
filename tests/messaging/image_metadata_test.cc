#include "messaging/image_metadata.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "messaging/message_bus.h"

namespace relocd {
namespace {

TEST(ImageMetadataTest, FindingUndoesSetting) {
  for (const std::int64_t number : {std::int64_t{0},
                                    std::int64_t{-1},
                                    std::int64_t{1'234'567'890'123},
                                    std::numeric_limits<std::int64_t>::min(),
                                    std::numeric_limits<std::int64_t>::max()}) {
    const ImageMetadata metadata{.mono_ns = number,
                                 .seq = number / 3,
                                 .run_id = -number / 5,
                                 .flags = static_cast<std::int32_t>(number % 1000),
                                 .exposure_us = 8000};
    image_t image{};
    SetImageMetadata(metadata, image);
    EXPECT_EQ(image.nmetadata, 5);
    EXPECT_EQ(FindImageMetadata(image), metadata);
  }
}

TEST(ImageMetadataTest, NumbersAreBigEndian) {
  image_t image{};
  SetImageMetadata({.mono_ns = 0x0102030405060708}, image);
  EXPECT_EQ(image.metadata[0].key, "mono_ns");
  EXPECT_THAT(image.metadata[0].value, testing::ElementsAre(1, 2, 3, 4, 5, 6, 7, 8));
}

TEST(ImageMetadataTest, AnImageOfAnotherPublisherHasNone) {
  image_t image{};
  image.nmetadata = 0;
  EXPECT_FALSE(FindImageMetadata(image));
  SetImageMetadata({.seq = 4}, image);
  image.metadata[1].value.pop_back();  // seq with seven bytes
  EXPECT_FALSE(FindImageMetadata(image));
}

TEST(ImageMetadataTest, FlagsAndExposureMayBeMissing) {
  image_t image{};
  SetImageMetadata({.mono_ns = 1, .seq = 2, .run_id = 3, .flags = 4, .exposure_us = 5}, image);
  image.metadata.resize(3);
  EXPECT_EQ(FindImageMetadata(image),
            (ImageMetadata{.mono_ns = 1, .seq = 2, .run_id = 3, .flags = 0, .exposure_us = -1}));
}

TEST(ImageMetadataTest, SaysWhereAnImageStandsInItsStream) {
  image_t image{};
  SetImageMetadata({.mono_ns = 1, .seq = 2, .run_id = 3}, image);
  const auto position = PositionOf(image);
  ASSERT_TRUE(position);
  EXPECT_EQ(position->seq, 2);
  EXPECT_EQ(position->run_id, 3);
}

}  // namespace
}  // namespace relocd
