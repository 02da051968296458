#include "messaging/bounded_decode.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "relocd/config_t.hpp"
#include "relocd/pose_t.hpp"

namespace relocd {
namespace {

template <typename Message>
std::vector<std::uint8_t> Encode(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

image_t SomeImage() {
  image_t image{};
  image.utime = 5;
  image.width = 4;
  image.height = 2;
  image.data = {1, 2, 3, 4, 5, 6, 7, 8};
  image.size = 8;
  image_metadata_t metadata{};
  metadata.key = "seq";
  metadata.value = {0, 0, 0, 0, 0, 0, 0, 9};
  metadata.n = 8;
  image.metadata = {metadata, metadata};
  image.nmetadata = 2;
  return image;
}

supervisor_t SomeSupervisor() {
  supervisor_t supervisor{};
  process_t process{};
  process.name = "odometryd";
  process.status_text = "ok";
  supervisor.processes = {process, process, process};
  supervisor.n = 3;
  return supervisor;
}

status_t SomeStatus() {
  status_t status{};
  status.daemon = "camerad_front";
  status.message = "no frames for 1.2 s";
  status_value_t value{};
  value.name = "frames";
  status.values = {value};
  status.n = 1;
  return status;
}

can_frames_t SomeCanFrames() {
  can_frames_t frames{};
  can_frame_t frame{};
  frame.can_id = 0x1A0;
  frame.data = {1, 2, 3};
  frame.size = 3;
  frames.frames = {frame, frame};
  frames.n = 2;
  return frames;
}

odometry_t SomeOdometry() {
  odometry_t odometry{};
  odometry.ticks = {5, 6};
  odometry.nwheels = 2;
  return odometry;
}

/// Flips, inserts, removes and overwrites bytes, the first ones (the lengths) more often than the
/// rest.
std::vector<std::uint8_t> Mutate(std::vector<std::uint8_t> bytes, std::mt19937& random) {
  const auto below = [&random](std::size_t limit) {
    return std::uniform_int_distribution<std::size_t>(0, limit - 1)(random);
  };
  const std::size_t changes = 1 + below(4);
  for (std::size_t i = 0; i < changes && !bytes.empty(); ++i) {
    const std::size_t at =
        below(2) == 0 ? below(bytes.size()) : 8 + below(std::min<std::size_t>(bytes.size(), 72));
    const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes.size() - 1));
    switch (below(4)) {
      case 0:
        *place ^= static_cast<std::uint8_t>(1U << below(8));
        break;
      case 1:
        *place = static_cast<std::uint8_t>(below(3) == 0 ? 0xFF : below(256));
        break;
      case 2:
        bytes.erase(place);
        break;
      default:
        bytes.insert(place, static_cast<std::uint8_t>(below(256)));
        break;
    }
  }
  return bytes;
}

template <typename Message>
void ExpectRoundTrip(const Message& message) {
  const std::vector<std::uint8_t> bytes = Encode(message);
  const auto decoded = DecodeBounded<Message>(bytes);
  ASSERT_TRUE(decoded.has_value());
  EXPECT_EQ(Encode(*decoded), bytes);
}

/// What is accepted must encode to what was received: a message is taken whole or not at all.
template <typename Message>
void ExpectNoMutantIsTrusted(const Message& message) {
  std::mt19937 random(1);
  const std::vector<std::uint8_t> bytes = Encode(message);
  int accepted = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    const std::vector<std::uint8_t> mutant = Mutate(bytes, random);
    const auto decoded = DecodeBounded<Message>(mutant);
    if (!decoded) continue;
    ++accepted;
    EXPECT_EQ(Encode(*decoded), mutant);
  }
  EXPECT_LT(accepted, 4000);
}

TEST(BoundedDecodeTest, DecodesWhatWasEncoded) {
  ExpectRoundTrip(SomeImage());
  ExpectRoundTrip(SomeSupervisor());
  ExpectRoundTrip(SomeStatus());
  ExpectRoundTrip(SomeCanFrames());
  ExpectRoundTrip(SomeOdometry());
  ExpectRoundTrip(camera_pose_t{});
  ExpectRoundTrip(localization_t{});
  ExpectRoundTrip(config_t{});
  ExpectRoundTrip(text_t{});
  ExpectRoundTrip(pose_t{});
}

TEST(BoundedDecodeTest, TrustsNoLengthInAMessage) {
  ExpectNoMutantIsTrusted(SomeImage());
  ExpectNoMutantIsTrusted(SomeSupervisor());
  ExpectNoMutantIsTrusted(SomeStatus());
  ExpectNoMutantIsTrusted(SomeCanFrames());
  ExpectNoMutantIsTrusted(SomeOdometry());
  ExpectNoMutantIsTrusted(camera_pose_t{});
  ExpectNoMutantIsTrusted(localization_t{});
  ExpectNoMutantIsTrusted(pose_t{});
}

TEST(BoundedDecodeTest, RefusesAMessageThatGoesOn) {
  std::vector<std::uint8_t> bytes = Encode(SomeImage());
  bytes.push_back(0);
  EXPECT_FALSE(DecodeBounded<image_t>(bytes).has_value());
}

TEST(BoundedDecodeTest, RefusesAnotherTypesMessage) {
  EXPECT_FALSE(DecodeBounded<pose_t>(Encode(SomeOdometry())).has_value());
  EXPECT_FALSE(DecodeBounded<odometry_t>(Encode(pose_t{})).has_value());
}

TEST(BoundedDecodeTest, RefusesMoreThanTheLimit) {
  can_frames_t frames{};
  frames.frames.resize(MessageLimits::kCanFrames + 1);
  frames.n = MessageLimits::kCanFrames + 1;
  EXPECT_FALSE(DecodeBounded<can_frames_t>(Encode(frames)).has_value());
}

}  // namespace
}  // namespace relocd
