#include "simulation/world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulation/torcs_test_track.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST(MakeWorld, PutsCarsOnATracksLanes) {
  const TemporaryFolder root;
  const std::string folder = TorcsTestTrack::Write(root);
  root.Write("tracks/road/test/grass.rgb", TorcsTestTrack::OnePixel('\x40', '\xff'));
  const auto world = MakeWorld("torcs:" + folder, 1);
  ASSERT_TRUE(world) << world.error().message;
  EXPECT_TRUE(world->scene.Validate());
  EXPECT_THAT(world->car_meshes, Not(IsEmpty()));
  EXPECT_THAT(world->traffic, Not(IsEmpty()));
}

TEST(MakeWorld, ListsTheWorldsForAnUnknownName) {
  EXPECT_THAT(WorldNames(), Contains("campus"));
  const auto world = MakeWorld("moon", 1);
  ASSERT_FALSE(world);
  EXPECT_EQ(world.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(world.error().message, HasSubstr("world 'moon' is unknown, must be one of campus"));
}

}  // namespace
}  // namespace relocd
