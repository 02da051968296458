#include "simulation/torcs_track.h"

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulation/torcs_ground.h"
#include "simulation/torcs_test_track.h"
#include "support/slow_build.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// From the point of the right-hand lane at `s` metres from the beginning.
double DistanceFromLane(const Eigen::Vector2d& p_W, double s) {
  return (TorcsTestTrack::PointAt(s, -2.5).head<2>() - p_W).norm();
}

/// Where in the right-hand lane, near `guess`, a point is.
double NearestInLane(const Eigen::Vector2d& p_W, double guess) {
  double best = guess;
  for (double ahead = -3.0; ahead < 4.0; ahead += 0.02) {
    const double s = std::fmod(guess + ahead + TorcsTestTrack::Length(), TorcsTestTrack::Length());
    if (DistanceFromLane(p_W, s) < DistanceFromLane(p_W, best)) best = s;
  }
  return best;
}

TEST(ReadTorcsTrack, MakesAWorldOfATrack) {
  const TemporaryFolder root;
  TorcsTestTrack::Write(root);
  EXPECT_THAT(ListTorcsTracks(root.path()), ElementsAre("test"));
  const auto world = ReadTorcsTrack("test", root.path());
  ASSERT_TRUE(world) << world.error().message;
  EXPECT_EQ(world->name, "torcs:test");
  EXPECT_TRUE(world->scene.Validate());
  EXPECT_EQ(world->scene.textures.size(), 3U);
  EXPECT_TRUE(world->route.is_closed);
  ASSERT_EQ(world->traffic.size(), 1U);

  // The route has its lane's distance from the middle, and the ground the road's height.
  double s = 0.0;
  for (const Eigen::Vector2d& p_W : world->route.points) {
    s = NearestInLane(p_W, s);
    EXPECT_LT(DistanceFromLane(p_W, s), 0.1) << s;
    EXPECT_NEAR(world->ground->HeightAt(p_W), TorcsTestTrack::PointAt(s, 0.0).z(), 0.05) << s;
  }
  EXPECT_GT(s, TorcsTestTrack::Length() - 2.0);
  // The other lane comes along on the left: its first point is the last one's neighbour.
  const Eigen::Vector2d oncoming = world->traffic[0].points[1] - world->traffic[0].points[0];
  const Eigen::Vector2d along = world->route.points[1] - world->route.points[0];
  EXPECT_LT(oncoming.dot(along), 0.0);
}

TEST(ReadTorcsTrack, TakesAFolder) {
  const TemporaryFolder root;
  const std::string folder = TorcsTestTrack::Write(root);
  for (const std::string& path : {folder, folder + "/", folder + "/../test/."}) {
    const auto world = ReadTorcsTrack(path, root.path());
    ASSERT_TRUE(world) << world.error().message;
    EXPECT_EQ(world->name, "torcs:" + path);
  }
}

TEST(ReadTorcsTrack, NamesTheNearestTrackForAnUnknownOne) {
  const TemporaryFolder root;
  TorcsTestTrack::Write(root);
  const auto world = ReadTorcsTrack("tset", root.path());
  ASSERT_FALSE(world);
  EXPECT_EQ(world.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(world.error().message,
            "unknown track 'tset', the nearest in " + root.path() +
                "/tracks is 'test'; a folder with a track is given with a slash, as in ./tset");
}

TEST(ReadTorcsTrack, SaysWhatToInstall) {
  const TemporaryFolder root;
  EXPECT_THAT(ListTorcsTracks(root.path()), IsEmpty());
  const auto world = ReadTorcsTrack("aalborg", root.path());
  ASSERT_FALSE(world);
  EXPECT_EQ(world.error().kind, ErrorKind::kUnavailable);
  EXPECT_EQ(world.error().message,
            "track 'aalborg': there are no tracks in " + root.path() +
                "/tracks; install Debian's torcs-data, or set RELOCD_TORCS_ROOT");
}

TEST(ReadTorcsTrack, NamesTheFileThatIsMissingOrDoesNotFit) {
  const TemporaryFolder root;
  const std::string folder = TorcsTestTrack::Write(root);
  const auto error = [&] {
    const auto world = ReadTorcsTrack("test", root.path());
    return world ? "" : world.error().message;
  };
  std::filesystem::remove(folder + "/asphalt.rgb");
  EXPECT_EQ(error(),
            folder +
                "/test.acc: line 5: object 'TKMN1': texture 'asphalt.rgb' is in none of the "
                "folders " +
                folder + ", " + root.path() + "/data/textures");
  std::string layout = TorcsTestTrack::Layout();
  layout.replace(layout.find("val=\"60\""), 8, "val=\"60.9\"");
  root.Write("tracks/road/test/test.xml", layout);
  EXPECT_THAT(error(),
              HasSubstr(folder + "/test.acc: the road as described fits the mesh nowhere"));
  std::filesystem::remove(folder + "/test.acc");
  EXPECT_THAT(error(), HasSubstr(folder + "/test.acc"));
  EXPECT_EQ(ReadTorcsTrack(root.path() + "/none/", root.path()).error().kind,
            ErrorKind::kUnavailable);
}

/// What holds for each track that there is.
void CheckInstalledTrack(const std::string& name) {
  const auto world = ReadTorcsTrack(name);
  ASSERT_TRUE(world) << world.error().message;
  EXPECT_TRUE(world->scene.Validate());
  EXPECT_GT(world->scene.CountTriangles(), 1000U);
  const auto ground = std::static_pointer_cast<const TorcsGround>(world->ground);
  const auto& points = world->route.points;
  ASSERT_GT(points.size(), 500U);
  double before = 0.0;
  for (std::size_t i = 0; i <= points.size(); ++i) {
    const Eigen::Vector2d& p_W = points[i % points.size()];
    const Eigen::Vector2d a = points[(i + 1) % points.size()] - p_W;
    const Eigen::Vector2d b = points[(i + 2) % points.size()] - points[(i + 1) % points.size()];
    ASSERT_NEAR(a.norm(), 1.0, 0.05) << i;
    const double turn = std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
    ASSERT_LT(std::abs(turn), 1.0 / 6.0) << i;
    const double z = ground->HeightAlong(p_W, std::atan2(a.y(), a.x()));
    if (i > 0) {
      ASSERT_LT(std::abs(z - before), 0.35) << i;
    }
    ASSERT_TRUE(ground->IsOnRoad({p_W.x(), p_W.y(), z}, 0.0)) << i;
    before = z;
  }
}

TEST(ReadTorcsTrack, ReadsAllThatAreInstalled) {
  const auto names = ListTorcsTracks();
  if (names.empty())
    GTEST_SKIP() << "Debian's torcs-data is not installed, and RELOCD_TORCS_ROOT names no folder";
  for (std::size_t i = 0; i < names.size(); i += kIsSlowBuild ? 10 : 1) {
    SCOPED_TRACE(names[i]);
    CheckInstalledTrack(names[i]);
  }
}

}  // namespace
}  // namespace relocd
