#include "simulation/campus.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "simulation/world.h"

namespace relocd {
namespace {

constexpr std::uint64_t kSeed = 7;

/// Built once, since a town takes a second.
const World& Campus() {
  static const World world = MakeCampus(kSeed).value();
  return world;
}

std::vector<Eigen::Vector2d> ClosedRoute() {
  std::vector<Eigen::Vector2d> points = Campus().route.points;
  points.push_back(points.front());
  return points;
}

double Length(const std::vector<Eigen::Vector2d>& points) {
  double length = 0.0;
  for (std::size_t i = 0; i + 1 < points.size(); ++i)
    length += (points[i + 1] - points[i]).norm();
  return length;
}

/// The turn at each point of the closed route, left positive.
std::vector<double> Turns() {
  const auto& points = Campus().route.points;
  const std::size_t count = points.size();
  std::vector<double> turns;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d before = points[i] - points[(i + count - 1) % count];
    const Eigen::Vector2d after = points[(i + 1) % count] - points[i];
    turns.push_back(std::atan2(before.x() * after.y() - before.y() * after.x(), before.dot(after)));
  }
  return turns;
}

/// Corners of all triangles of the scene in W.
template <typename Visit>
void VisitTriangles(const Scene& scene, Visit&& visit) {
  for (const MeshInstance& instance : scene.instances) {
    const Mesh& mesh = scene.meshes[instance.mesh];
    for (const auto& triangle : mesh.triangles) {
      visit(Eigen::Vector3f(instance.X_WM * mesh.positions[triangle[0]]),
            Eigen::Vector3f(instance.X_WM * mesh.positions[triangle[1]]),
            Eigen::Vector3f(instance.X_WM * mesh.positions[triangle[2]]));
    }
  }
}

/// How far points of the route are away, found through squares of 4 m.
class RouteIndex {
 public:
  explicit RouteIndex(const std::vector<Eigen::Vector2d>& points) {
    for (const Eigen::Vector2d& p : points) {
      const Eigen::Vector2i square = SquareOf(p);
      if ((square.array() >= 0).all() && (square.array() < kSide).all())
        squares_[Index(square)].push_back(p);
    }
  }

  [[nodiscard]] double DistanceTo(const Eigen::Vector2d& p) const {
    const Eigen::Vector2i square = SquareOf(p);
    double nearest = kSquare;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const Eigen::Vector2i near = square + Eigen::Vector2i(dx, dy);
        if ((near.array() < 0).any() || (near.array() >= kSide).any()) continue;
        for (const Eigen::Vector2d& q : squares_[Index(near)])
          nearest = std::min(nearest, (q - p).norm());
      }
    }
    return nearest;
  }

 private:
  static constexpr double kSquare = 4.0;
  static constexpr int kSide = 256;

  static Eigen::Vector2i SquareOf(const Eigen::Vector2d& p) {
    return (p / kSquare).array().floor().cast<int>() + kSide / 2;
  }
  static std::size_t Index(const Eigen::Vector2i& square) {
    return static_cast<std::size_t>(square.y() * kSide + square.x());
  }

  std::vector<std::vector<Eigen::Vector2d>> squares_{static_cast<std::size_t>(kSide) * kSide};
};

bool HasSameBytes(const Mesh& a, const Mesh& b) {
  return a.positions == b.positions && a.normals == b.normals && a.uvs == b.uvs &&
         a.triangles == b.triangles && a.triangle_materials == b.triangle_materials;
}

TEST(CampusTest, SceneIsValid) {
  const auto valid = Campus().scene.Validate();
  EXPECT_TRUE(valid) << (valid ? "" : valid.error().message);
}

TEST(CampusTest, SameSeedGivesTheSameTown) {
  const World again = MakeCampus(kSeed).value();
  const Scene& scene = Campus().scene;
  ASSERT_EQ(scene.meshes.size(), again.scene.meshes.size());
  for (std::size_t i = 0; i < scene.meshes.size(); ++i)
    ASSERT_TRUE(HasSameBytes(scene.meshes[i], again.scene.meshes[i])) << i;
  ASSERT_EQ(scene.instances.size(), again.scene.instances.size());
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    ASSERT_EQ(scene.instances[i].mesh, again.scene.instances[i].mesh);
    ASSERT_EQ(scene.instances[i].X_WM.matrix(), again.scene.instances[i].X_WM.matrix());
  }
  for (std::size_t i = 0; i < scene.textures.size(); ++i) {
    for (const float u : {0.11F, 0.52F, 0.93F})
      ASSERT_TRUE((scene.textures[i].Sample(u, 0.37F, 0.0F) ==
                   again.scene.textures[i].Sample(u, 0.37F, 0.0F))
                      .all());
  }
  EXPECT_EQ(Campus().route.points, again.route.points);
}

TEST(CampusTest, AnotherSeedGivesAnotherTown) {
  const World other = MakeCampus(kSeed + 1).value();
  EXPECT_NE(Campus().route.points, other.route.points);
  EXPECT_NE(Campus().scene.CountTriangles(), other.scene.CountTriangles());
}

TEST(CampusTest, StaysWithinItsBudget) {
  const Scene& scene = Campus().scene;
  std::size_t unique = 0;
  for (const Mesh& mesh : scene.meshes)
    unique += mesh.triangles.size();
  std::size_t texels = 0;
  for (const Texture& texture : scene.textures)
    texels +=
        static_cast<std::size_t>(texture.width()) * static_cast<std::size_t>(texture.height());
  EXPECT_LE(scene.CountTriangles(), 1'500'000U);
  EXPECT_LE(unique, 400'000U);
  EXPECT_LE(texels * 4 * 4 / 3, 120'000'000U);
}

TEST(CampusTest, RouteIsClosedAndOfTheLengthThatWasAskedFor) {
  EXPECT_TRUE(Campus().route.is_closed);
  const std::vector<Eigen::Vector2d> route = ClosedRoute();
  EXPECT_GT(Length(route), 620.0);
  EXPECT_LT(Length(route), 700.0);
  for (std::size_t i = 0; i + 1 < route.size(); ++i)
    ASSERT_NEAR((route[i + 1] - route[i]).norm(), 0.5, 0.02);
}

TEST(CampusTest, RouteTurnsRoundOnceAndLeftInAll) {
  const std::vector<double> turns = Turns();
  double total = 0.0;
  double most_within_40_m = 0.0;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    total += turns[i];
    double within = 0.0;
    for (std::size_t j = 0; j < 80; ++j)
      within += turns[(i + j) % turns.size()];
    most_within_40_m = std::max(most_within_40_m, within);
  }
  // Four corners to the left; two turns into and out of the spur, which its own turn outweighs.
  EXPECT_NEAR(total, 2.0 * std::numbers::pi, 1e-6);
  EXPECT_GT(most_within_40_m, 0.99 * std::numbers::pi);
}

TEST(CampusTest, RouteCanBeDriven) {
  const std::vector<double> turns = Turns();
  for (std::size_t i = 0; i < turns.size(); ++i)
    ASSERT_LT(std::abs(turns[i]) / 0.5, 1.0 / 6.0) << Campus().route.points[i].transpose();
  // Curvature does not jump: the wheel must be turned.
  for (std::size_t i = 0; i + 1 < turns.size(); ++i)
    ASSERT_LT(std::abs(turns[i + 1] - turns[i]) / 0.5, 0.08)
        << Campus().route.points[i].transpose();
}

TEST(CampusTest, GroundSlopesButNeverMoreThanThreePercent) {
  const std::vector<Eigen::Vector2d> route = ClosedRoute();
  double steepest = 0.0;
  for (std::size_t i = 0; i + 1 < route.size(); ++i) {
    const double rise =
        Campus().ground->HeightAt(route[i + 1]) - Campus().ground->HeightAt(route[i]);
    steepest = std::max(steepest, std::abs(rise) / (route[i + 1] - route[i]).norm());
  }
  EXPECT_LT(steepest, 0.03);
  EXPECT_GT(steepest, 0.008);
}

TEST(CampusTest, RouteStaysOnTheRoad) {
  // Kerbs are 0.12 m high: both sides of the vehicle are on one level.
  const std::vector<Eigen::Vector2d> route = ClosedRoute();
  for (std::size_t i = 0; i + 1 < route.size(); ++i) {
    const Eigen::Vector2d forward = (route[i + 1] - route[i]).normalized();
    const Eigen::Vector2d left(-forward.y(), forward.x());
    const double middle = Campus().ground->HeightAt(route[i]);
    for (const double aside : {-1.3, -0.8, 0.8, 1.3})
      ASSERT_NEAR(Campus().ground->HeightAt(route[i] + aside * left), middle, 0.06)
          << route[i].transpose();
  }
}

TEST(CampusTest, GroundIsWhatIsRendered) {
  const std::vector<Eigen::Vector2d> route = ClosedRoute();
  // The highest triangle below or above points of the route: the road, or paint upon it.
  std::vector<double> rendered(route.size(), -100.0);
  constexpr std::size_t kStride = 20;
  VisitTriangles(Campus().scene, [&](const auto& a, const auto& b, const auto& c) {
    const Eigen::Vector3f low = a.cwiseMin(b).cwiseMin(c);
    const Eigen::Vector3f high = a.cwiseMax(b).cwiseMax(c);
    for (std::size_t i = 0; i < route.size(); i += kStride) {
      const Eigen::Vector2d& p = route[i];
      if (p.x() < low.x() || p.y() < low.y() || p.x() > high.x() || p.y() > high.y()) continue;
      const Eigen::Vector3d n = (b - a).cross(c - a).template cast<double>();
      if (n.z() <= 0.0) continue;
      const auto inside = [&p](const Eigen::Vector3f& from, const Eigen::Vector3f& to) {
        const Eigen::Vector2d edge = (to - from).template head<2>().template cast<double>();
        const Eigen::Vector2d arm = p - from.template head<2>().template cast<double>();
        return edge.x() * arm.y() - edge.y() * arm.x() >= 0.0;
      };
      if (!inside(a, b) || !inside(b, c) || !inside(c, a)) continue;
      const double z = a.z() - ((p.x() - a.x()) * n.x() + (p.y() - a.y()) * n.y()) / n.z();
      if (z < Campus().ground->HeightAt(p) + 0.3) rendered[i] = std::max(rendered[i], z);
    }
  });
  for (std::size_t i = 0; i < route.size(); i += kStride)
    ASSERT_NEAR(rendered[i], Campus().ground->HeightAt(route[i]) + 0.005, 0.008)
        << route[i].transpose();
}

TEST(CampusTest, NothingStandsInTheVehiclesWay) {
  constexpr double kHalfWidth = 1.15;
  const RouteIndex route(Campus().route.points);
  std::size_t hits = 0;
  VisitTriangles(Campus().scene, [&](const auto& a, const auto& b, const auto& c) {
    const float longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
    const int steps = std::clamp(static_cast<int>(longest / 0.4F) + 1, 1, 60);
    for (int i = 0; i <= steps; ++i) {
      for (int j = 0; j + i <= steps; ++j) {
        const Eigen::Vector3f p = a +
                                  (b - a) * (static_cast<float>(i) / static_cast<float>(steps)) +
                                  (c - a) * (static_cast<float>(j) / static_cast<float>(steps));
        const Eigen::Vector2d q = p.template head<2>().template cast<double>();
        const double above = p.z() - Campus().ground->HeightAt(q);
        if (above < 0.3 || above > 2.0 || route.DistanceTo(q) > kHalfWidth) continue;
        if (++hits < 5) ADD_FAILURE() << p.transpose();
        return;
      }
    }
  });
  EXPECT_EQ(hits, 0U);
}

TEST(CampusTest, RouteIsClearOfParkedCars) {
  ASSERT_GE(Campus().parking_spots.size(), 30U);
  for (const ParkingSpot& spot : Campus().parking_spots) {
    for (const double along : {-2.4, 0.0, 2.4}) {
      const Eigen::Vector2d p = spot * Eigen::Vector2d(along, 0.0);
      for (const Eigen::Vector2d& q : Campus().route.points)
        ASSERT_GT((p - q).norm(), 0.95 + 1.05) << spot;
      EXPECT_NEAR(Campus().ground->HeightAt(p), Campus().ground->HeightAt(spot.translation()), 0.1)
          << spot << " is not level";
    }
  }
}

TEST(CampusTest, TrafficKeepsToItsLaneExceptAtCrossings) {
  ASSERT_FALSE(Campus().traffic.empty());
  std::size_t near = 0;
  std::size_t all = 0;
  for (const Path& path : Campus().traffic) {
    for (const Eigen::Vector2d& p : path.points) {
      double nearest = 1e9;
      for (const Eigen::Vector2d& q : Campus().route.points)
        nearest = std::min(nearest, (p - q).norm());
      ++all;
      if (nearest < 2.5) ++near;
    }
  }
  EXPECT_LT(static_cast<double>(near), 0.12 * static_cast<double>(all));
}

TEST(CampusTest, LampsStandAlongTheWholeRoute) {
  EXPECT_GE(Campus().scene.lamps.size(), 25U);
  for (const Eigen::Vector2d& p : Campus().route.points) {
    double nearest = 1e9;
    for (const Lamp& lamp : Campus().scene.lamps)
      nearest = std::min(nearest, (lamp.p_WL.head<2>().cast<double>() - p).norm());
    ASSERT_LT(nearest, 38.0) << p.transpose();
  }
}

TEST(CampusTest, CarsAndPeopleStandOnTheGroundAndAreOfTheirSize) {
  const auto extent = [](std::uint32_t index) {
    Eigen::AlignedBox3f box;
    for (const Eigen::Vector3f& p : Campus().scene.meshes[index].positions)
      box.extend(p);
    return box;
  };
  EXPECT_GE(Campus().car_meshes.size(), 5U);
  for (const std::uint32_t mesh : Campus().car_meshes) {
    const Eigen::AlignedBox3f box = extent(mesh);
    EXPECT_NEAR(box.min().z(), 0.0F, 0.02F);
    EXPECT_GT(box.sizes().x(), 3.5F);
    EXPECT_LT(box.sizes().x(), 6.1F);
    EXPECT_LT(box.sizes().y(), 2.5F);
    EXPECT_LT(box.sizes().z(), 3.0F);
  }
  EXPECT_GE(Campus().pedestrian_meshes.size(), 4U);
  for (const std::uint32_t mesh : Campus().pedestrian_meshes) {
    const Eigen::AlignedBox3f box = extent(mesh);
    EXPECT_NEAR(box.min().z(), 0.0F, 0.02F);
    EXPECT_NEAR(box.max().z(), 1.78F, 0.08F);
  }
}

TEST(CampusTest, WalkwaysAreBesideTheRoad) {
  ASSERT_FALSE(Campus().walkways.empty());
  for (const Path& walkway : Campus().walkways) {
    for (const Eigen::Vector2d& p : walkway.points) {
      for (const Eigen::Vector2d& q : Campus().route.points)
        ASSERT_GT((p - q).norm(), 1.6);
    }
  }
}

}  // namespace
}  // namespace relocd
