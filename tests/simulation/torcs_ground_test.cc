#include "simulation/torcs_ground.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/random.h"

namespace relocd {
namespace {

using Triangle = TorcsGround::Triangle;

constexpr double kWidth = 8.0;

/// A figure of eight whose branches cross 6 m above each other.
struct Eight {
  static Eigen::Vector3d Middle(double t) {
    return {80.0 * std::sin(t), 80.0 * std::sin(t) * std::cos(t), 3.0 + 3.0 * std::cos(t)};
  }

  static std::vector<TorcsStation> Stations() {
    std::vector<TorcsStation> stations;
    constexpr int kCount = 1000;
    for (int i = 0; i < kCount; ++i) {
      const double t = 2.0 * std::numbers::pi * i / kCount;
      const Eigen::Vector3d p = Middle(t);
      const Eigen::Vector3d ahead = Middle(t + 1e-4) - p;
      stations.push_back({.p_T = p.head<2>(),
                          .yaw_T_rad = std::atan2(ahead.y(), ahead.x()),
                          .left_z_T = p.z(),
                          .right_z_T = p.z(),
                          .s_m = 0.0,
                          .is_mesh_boundary = true});
    }
    return stations;
  }

  static std::vector<Triangle> Triangles(const std::vector<TorcsStation>& stations) {
    std::vector<Triangle> triangles;
    const auto edge = [&](std::size_t i, double side) {
      const TorcsStation& station = stations[i % stations.size()];
      const Eigen::Vector2d left(-std::sin(station.yaw_T_rad), std::cos(station.yaw_T_rad));
      const Eigen::Vector2d p = station.p_T + side * kWidth * left;
      return Eigen::Vector3d(p.x(), p.y(), station.left_z_T).cast<float>().eval();
    };
    for (std::size_t i = 0; i < stations.size(); ++i) {
      triangles.push_back({edge(i, -0.5), edge(i + 1, -0.5), edge(i + 1, 0.5)});
      triangles.push_back({edge(i, -0.5), edge(i + 1, 0.5), edge(i, 0.5)});
    }
    return triangles;
  }
};

/// A straight road there and back far apart, so that there is one branch near the origin.
std::vector<TorcsStation> Oblong() {
  std::vector<TorcsStation> stations;
  for (int x = -50; x < 50; ++x) {
    stations.push_back({.p_T = {x, 0.0}});
  }
  for (int x = 50; x > -50; --x) {
    stations.push_back({.p_T = {x, 200.0}, .yaw_T_rad = std::numbers::pi});
  }
  return stations;
}

/// A square of 100 m round the origin, cut along x = 0 where it bends.
std::vector<Triangle> Roof(double height, double slope) {
  const auto z = [&](double x) { return static_cast<float>(height + slope * std::abs(x)); };
  std::vector<Triangle> triangles;
  for (const float x : {-50.0F, 50.0F}) {
    const Eigen::Vector3f a(0.0F, -50.0F, z(0.0));
    const Eigen::Vector3f b(x, -50.0F, z(x));
    const Eigen::Vector3f c(x, 50.0F, z(x));
    const Eigen::Vector3f d(0.0F, 50.0F, z(0.0));
    triangles.push_back({a, b, c});
    triangles.push_back({a, c, d});
  }
  return triangles;
}

std::shared_ptr<const TorcsGround> MakeGround(const std::vector<TorcsStation>& stations,
                                              const std::vector<Triangle>& triangles) {
  return TorcsGround::Create(stations, kWidth, triangles).value();
}

TEST(TorcsGround, TellsBridgesByTheHeading) {
  const auto stations = Eight::Stations();
  const auto ground = MakeGround(stations, Eight::Triangles(stations));
  TestRandom random(3);
  for (int i = 0; i < 4000; ++i) {
    const double t = 2.0 * std::numbers::pi * i / 4000.0;
    const Eigen::Vector3d p = Eight::Middle(t);
    const Eigen::Vector3d ahead = Eight::Middle(t + 1e-4) - p;
    const double heading = std::atan2(ahead.y(), ahead.x()) + random.Uniform(-0.1, 0.1);
    ASSERT_NEAR(ground->HeightAlong(p.head<2>(), heading), p.z(), 0.06) << t;
    const double backwards = heading + std::numbers::pi;
    ASSERT_NEAR(ground->HeightAlong(p.head<2>(), backwards), p.z(), 0.06) << t;
  }
  const double crossing = ground->HeightAt({0.0, 0.0});
  EXPECT_TRUE(std::abs(crossing) < 0.06 || std::abs(crossing - 6.0) < 0.06) << crossing;
}

TEST(TorcsGround, ChoosesTheSurfaceThatTheRoadRunsOn) {
  std::vector<Triangle> triangles = Roof(5.0, 0.0);
  for (const Triangle& triangle : Roof(0.1, 0.0)) {
    triangles.push_back(triangle);
  }
  for (const Triangle& triangle : Roof(-2.0, 0.0)) {
    triangles.push_back(triangle);
  }
  const auto ground = MakeGround(Oblong(), triangles);
  TestRandom random(1);
  for (int trial = 0; trial < 500; ++trial) {
    EXPECT_NEAR(ground->HeightAt(4.0 * random.Point()), 0.1, 1e-6);
  }
}

TEST(TorcsGround, BendsGradually) {
  constexpr double kSlope = 0.1;
  const auto ground = MakeGround(Oblong(), Roof(0.0, kSlope));
  EXPECT_NEAR(ground->HeightAt({20.0, 3.0}), 2.0, 1e-6);
  double before = -kSlope;
  for (double x = -3.0; x < 3.0; x += 0.05) {
    const double slope = (ground->HeightAt({x + 0.005, 1.0}) - ground->HeightAt({x, 1.0})) / 0.005;
    EXPECT_GE(slope, before - 1e-3);
    // The mesh bends by twice the slope at once.
    EXPECT_LE(slope, before + 1.01 * kSlope) << x;
    before = slope;
  }
  EXPECT_NEAR(before, kSlope, 1e-3);
}

TEST(TorcsGround, DoesNotSmoothSteps) {
  std::vector<Triangle> triangles = Roof(0.0, 0.0);
  // A wall of 0.6 m along y = 3.
  triangles.push_back({Eigen::Vector3f(-40, 3, 0.6F), {40, 3, 0.6F}, {40, 3.4F, 0.6F}});
  const auto ground = MakeGround(Oblong(), triangles);
  for (double y = 0.0; y < 2.99; y += 0.1) {
    EXPECT_NEAR(ground->HeightAt({10.0, y}), 0.0, 1e-6) << y;
  }
}

TEST(TorcsGround, GoesOnAsDescribedWhereThereIsNoMesh) {
  std::vector<TorcsStation> stations = Oblong();
  for (TorcsStation& station : stations) {
    station.left_z_T = 2.4;
    station.right_z_T = 1.6;
  }
  const auto ground = MakeGround(stations, {});
  EXPECT_NEAR(ground->HeightAt({0.0, 0.0}), 2.0, 1e-9);
  EXPECT_NEAR(ground->HeightAt({0.0, 2.0}), 2.2, 1e-9);
  EXPECT_TRUE(std::isfinite(ground->HeightAt({1e6, -1e6})));
  EXPECT_TRUE(std::isfinite(ground->HeightAlong({-1e6, 1e6}, 5.0)));
}

TEST(TorcsGround, KnowsItsRoad) {
  const auto ground = MakeGround(Oblong(), {});
  EXPECT_TRUE(ground->IsOnRoad({10.0, 3.9, 0.1}, 0.0));
  EXPECT_FALSE(ground->IsOnRoad({10.0, 3.9, 1.0}, 0.0));
  EXPECT_FALSE(ground->IsOnRoad({10.0, 5.5, 0.0}, 0.0));
  EXPECT_TRUE(ground->IsOnRoad({10.0, 5.5, 0.0}, 2.0));
}

TEST(TorcsGround, FindsTheNearestStationAsASearchThroughAllDoes) {
  const auto stations = Eight::Stations();
  const auto ground = MakeGround(stations, {});
  TestRandom random(2);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Vector2d p = 15.0 * random.Point();
    const auto nearest = std::min_element(
        stations.begin(), stations.end(), [&](const TorcsStation& a, const TorcsStation& b) {
          return (a.p_T - p).norm() < (b.p_T - p).norm();
        });
    EXPECT_NEAR(ground->HeightAt(p), nearest->left_z_T, 0.05);
  }
}

}  // namespace
}  // namespace relocd
