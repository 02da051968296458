#include "rendering/sgi_image.h"

#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "camera/jpeg.h"
#include "support/mutate_bytes.h"
#include "support/random.h"

namespace relocd {
namespace {

using ::testing::HasSubstr;

void PutBigEndian(std::string& bytes, std::size_t offset, std::size_t size, std::size_t value) {
  for (std::size_t i = 0; i < size; ++i) {
    bytes[offset + i] = static_cast<char>(value >> 8U * (size - 1 - i) & 0xffU);
  }
}

std::string SgiHeader(int width, int height, int channels, bool is_run_length_encoded) {
  std::string bytes(512, '\0');
  PutBigEndian(bytes, 0, 2, 0x01da);
  bytes[2] = is_run_length_encoded ? '\1' : '\0';
  bytes[3] = '\1';
  PutBigEndian(bytes, 4, 2, channels == 1 ? 2 : 3);
  PutBigEndian(bytes, 6, 2, static_cast<std::size_t>(width));
  PutBigEndian(bytes, 8, 2, static_cast<std::size_t>(height));
  PutBigEndian(bytes, 10, 2, static_cast<std::size_t>(channels));
  return bytes;
}

/// The image that `channels` planes stand for, as the reader must give it.
struct Planes {
  int width = 0;
  int height = 0;
  std::vector<std::string> channels;  ///< Rows from the bottom.

  [[nodiscard]] std::string Row(std::size_t channel, int y) const {
    return channels[channel].substr(static_cast<std::size_t>(y * width),
                                    static_cast<std::size_t>(width));
  }
  [[nodiscard]] std::uint8_t At(std::size_t channel, int x, int y) const {
    return static_cast<std::uint8_t>(channels[channel][static_cast<std::size_t>(y * width + x)]);
  }
};

Planes RandomPlanes(TestRandom& random, int channels) {
  Planes planes{.width = random.Integer(1, 40), .height = random.Integer(1, 9), .channels = {}};
  for (int c = 0; c < channels; ++c) {
    std::string plane;
    while (plane.size() < static_cast<std::size_t>(planes.width * planes.height)) {
      // Runs and noise, so that both kinds of packets come.
      const int run = random.Integer(0, 1) == 0 ? 1 : random.Integer(2, 30);
      plane.append(static_cast<std::size_t>(run), static_cast<char>(random.Integer(0, 255)));
    }
    plane.resize(static_cast<std::size_t>(planes.width * planes.height));
    planes.channels.push_back(plane);
  }
  return planes;
}

std::string WritePlain(const Planes& planes) {
  std::string bytes =
      SgiHeader(planes.width, planes.height, static_cast<int>(planes.channels.size()), false);
  for (const std::string& plane : planes.channels) {
    bytes += plane;
  }
  return bytes;
}

std::string EncodeRow(const std::string& row) {
  std::string packets;
  for (std::size_t i = 0; i < row.size();) {
    const std::size_t end = std::min({row.find_first_not_of(row[i], i), row.size(), i + 127});
    if (end - i > 2) {
      packets += static_cast<char>(end - i);
      packets += row[i];
      i = end;
    } else {
      packets += '\x81';
      packets += row[i++];
    }
  }
  return packets + '\0';
}

std::string WriteRunLengths(const Planes& planes) {
  std::string bytes =
      SgiHeader(planes.width, planes.height, static_cast<int>(planes.channels.size()), true);
  const std::size_t rows = static_cast<std::size_t>(planes.height) * planes.channels.size();
  bytes.resize(512 + 8 * rows);
  for (std::size_t i = 0; i < rows; ++i) {
    const std::string packets =
        EncodeRow(planes.Row(i / static_cast<std::size_t>(planes.height),
                             static_cast<int>(i % static_cast<std::size_t>(planes.height))));
    PutBigEndian(bytes, 512 + 4 * i, 4, bytes.size());
    PutBigEndian(bytes, 512 + 4 * (rows + i), 4, packets.size());
    bytes += packets;
  }
  return bytes;
}

std::string ReadError(const std::string& bytes) {
  const auto image = ReadSgiImage(AsBytes(bytes));
  return image ? "" : image.error().message;
}

/// What the reader must give, the top row first.
std::vector<std::uint8_t> PixelsOf(const Planes& planes) {
  const std::size_t count = planes.channels.size();
  const bool is_gray = count <= 2;
  std::vector<std::uint8_t> pixels;
  for (int y = planes.height - 1; y >= 0; --y) {
    for (int x = 0; x < planes.width; ++x) {
      const std::uint8_t coverage = count % 2 == 0 ? planes.At(count - 1, x, y) : 255;
      pixels.insert(pixels.end(),
                    {planes.At(0, x, y),
                     planes.At(is_gray ? 0 : 1, x, y),
                     planes.At(is_gray ? 0 : 2, x, y),
                     coverage});
    }
  }
  return pixels;
}

TEST(ReadSgiImage, GivesAllPixelsOfAllKindsTheTopRowFirst) {
  TestRandom random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Planes planes = RandomPlanes(random, 1 + trial % 4);
    for (const std::string& bytes : {WritePlain(planes), WriteRunLengths(planes)}) {
      const auto image = ReadSgiImage(AsBytes(bytes));
      ASSERT_TRUE(image) << image.error().message;
      EXPECT_EQ(image->width, planes.width);
      EXPECT_EQ(image->height, planes.height);
      EXPECT_EQ(image->pixels, PixelsOf(planes));
    }
  }
}

TEST(ReadSgiImage, RefusesWhatIsCutShortAnywhere) {
  TestRandom random(2);
  const Planes planes = RandomPlanes(random, 3);
  const std::string plain = WritePlain(planes);
  for (std::size_t size = 0; size < plain.size(); ++size) {
    EXPECT_THAT(ReadError(plain.substr(0, size)), HasSubstr("SGI image: has")) << size;
  }
  // The last byte only says that the last row ends.
  const std::string run_lengths = WriteRunLengths(planes);
  for (std::size_t size = 0; size + 1 < run_lengths.size(); ++size) {
    EXPECT_THAT(ReadError(run_lengths.substr(0, size)), HasSubstr("SGI image: ")) << size;
  }
}

TEST(ReadSgiImage, SaysWhatIsWrongInAHeader) {
  const std::string good = SgiHeader(2, 2, 1, false) + std::string(4, 'x');
  ASSERT_EQ(ReadError(good), "");
  const auto with = [&](std::size_t offset, std::size_t size, std::size_t value) {
    std::string bytes = good;
    PutBigEndian(bytes, offset, size, value);
    return ReadError(bytes);
  };
  EXPECT_EQ(with(0, 2, 0x1234), "SGI image: starts with 0x1234, must with 0x01da");
  EXPECT_EQ(with(2, 1, 2), "SGI image: storage is 2, must be 0 (plain) or 1 (run-length encoded)");
  EXPECT_EQ(with(3, 1, 2), "SGI image: has 2 bytes a channel, must have 1");
  EXPECT_EQ(with(4, 2, 4), "SGI image: has 4 dimensions, must have 1, 2 or 3");
  EXPECT_THAT(with(6, 2, 0), HasSubstr("image of 0 x 2 px, sides must be in [1, 8192]"));
  EXPECT_THAT(with(6, 2, 65535), HasSubstr("image of 65535 x 2 px"));
  EXPECT_EQ(with(104, 4, 1), "SGI image: colour map is 1, must be 0 (none)");
  std::string five = good;
  PutBigEndian(five, 4, 2, 3);
  PutBigEndian(five, 10, 2, 5);
  EXPECT_EQ(ReadError(five), "SGI image: has 5 channels, must have 1 to 4");
}

TEST(ReadSgiImage, SaysWhichRowIsDamaged) {
  Planes planes{.width = 3, .height = 2, .channels = {"aaabbb", "cccddd", "eeefff"}};
  std::string bytes = WriteRunLengths(planes);
  PutBigEndian(bytes, 512 + 4 * 3, 4, 70'000);
  EXPECT_EQ(ReadError(bytes),
            "row 1 of channel 1: SGI image: starts at byte 70000, must be below " +
                std::to_string(bytes.size()));
  bytes = WriteRunLengths(planes);
  bytes[512 + 8 * 6] = '\5';
  EXPECT_EQ(ReadError(bytes), "row 0 of channel 0: SGI image: run of 5, must be in [1, 3]");
}

TEST(ReadSgiImage, SurvivesAnyBytes) {
  TestRandom random(3);
  const Planes planes = RandomPlanes(random, 4);
  for (const std::string& bytes : {WritePlain(planes), WriteRunLengths(planes)}) {
    for (int trial = 0; trial < 5000; ++trial) {
      std::string damaged = MutateBytes(bytes, random);
      // The header's unused bytes would take most of the damage.
      if (trial % 2 == 0 && damaged.size() > 12)
        damaged[static_cast<std::size_t>(random.Integer(2, 11))] =
            static_cast<char>(random.Integer(0, 4));
      const auto image = ReadSgiImage(AsBytes(damaged));
      if (!image) continue;
      EXPECT_EQ(image->pixels.size(), static_cast<std::size_t>(4 * image->width * image->height));
    }
  }
}

}  // namespace
}  // namespace relocd
