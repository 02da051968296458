#include "simulation/torcs_placement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulation/torcs_test_track.h"
#include "support/random.h"

namespace relocd {
namespace {

/// Both edges of all steps of the road, moved, among other vertices.
std::vector<Eigen::Vector3f> Vertices(const TorcsLayout& layout,
                                      const Eigen::Vector3d& p_WT,
                                      TestRandom& random) {
  std::vector<Eigen::Vector3f> vertices;
  for (const TorcsStation& station : layout.stations) {
    if (!station.is_mesh_boundary) continue;
    const Eigen::Vector2d left(-std::sin(station.yaw_T_rad), std::cos(station.yaw_T_rad));
    for (const double side : {0.5, -0.5}) {
      const Eigen::Vector2d p = station.p_T + side * layout.width_m * left;
      const double z = side > 0 ? station.left_z_T : station.right_z_T;
      const Eigen::Vector3d noise(random.Normal(0.01), random.Normal(0.01), random.Normal(0.01));
      vertices.push_back((Eigen::Vector3d(p.x(), p.y(), z) + p_WT + noise).cast<float>());
    }
    vertices.push_back((100.0 * random.Point3()).cast<float>());
  }
  std::shuffle(vertices.begin(), vertices.end(), random.engine());
  return vertices;
}

TEST(FindTrackInMesh, FindsThePlaceWhereEdgesAreVertices) {
  TestRandom random(1);
  const auto layout = ParseTorcsLayout(TorcsTestTrack::Layout(), "a.xml");
  ASSERT_TRUE(layout);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Vector3d p_WT = 100.0 * random.Point3();
    const auto found = FindTrackInMesh(*layout, Vertices(*layout, p_WT, random));
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_LT((*found - p_WT).norm(), 0.1);
  }
}

TEST(FindTrackInMesh, RefusesAnotherTracksMesh) {
  TestRandom random(2);
  const auto layout = ParseTorcsLayout(TorcsTestTrack::Layout(), "a.xml");
  ASSERT_TRUE(layout);
  TorcsLayout other = *layout;
  for (TorcsStation& station : other.stations) {
    station.p_T.x() *= 1.1;
  }
  const auto found = FindTrackInMesh(*layout, Vertices(other, {5.0, 6.0, 7.0}, random));
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().message,
              ::testing::HasSubstr("the road as described fits the mesh nowhere: at best"));
  EXPECT_FALSE(FindTrackInMesh(*layout, {}));
}

}  // namespace
}  // namespace relocd
