#include <cstdint>

#include <gtest/gtest.h>

#include "relocd/image_t.hpp"
#include "relocd/pose_t.hpp"
#include "relocd/rigid_transform_t.hpp"

namespace relocd {
namespace {

/// LCM's fingerprint of a struct: a type's base (a hash of its fields' names and types) and those
/// of the structs in it, summed and rotated left by one bit.
constexpr std::uint64_t RotateLeft(std::uint64_t value) {
  return value << 1 | value >> 63;
}

// The bases that lcm-gen wrote into libbot2's published bindings of bot_core.
constexpr std::uint64_t kBotCorePoseBase = 0x170b77d82958082f;
constexpr std::uint64_t kBotCoreImageMetadataBase = 0x4d25b1a682bbfdc7;
constexpr std::uint64_t kBotCoreImageBase = 0x6fee6cb20472ff6a;
constexpr std::uint64_t kBotCoreRigidTransformBase = 0x754ffdf95662e2d7;

template <typename Message>
std::uint64_t Fingerprint() {
  return static_cast<std::uint64_t>(Message::getHash());
}

TEST(WireLayoutTest, PoseIsThatOfBotCore) {
  EXPECT_EQ(Fingerprint<pose_t>(), RotateLeft(kBotCorePoseBase));
}

TEST(WireLayoutTest, ImageMetadataIsThatOfBotCore) {
  EXPECT_EQ(Fingerprint<image_metadata_t>(), RotateLeft(kBotCoreImageMetadataBase));
}

TEST(WireLayoutTest, ImageIsThatOfBotCore) {
  EXPECT_EQ(Fingerprint<image_t>(),
            RotateLeft(kBotCoreImageBase + RotateLeft(kBotCoreImageMetadataBase)));
}

TEST(WireLayoutTest, RigidTransformIsThatOfBotCore) {
  EXPECT_EQ(Fingerprint<rigid_transform_t>(), RotateLeft(kBotCoreRigidTransformBase));
}

}  // namespace
}  // namespace relocd
