#include "simulation/campus_roads.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "simulation/campus_random.h"

namespace relocd {
namespace {

constexpr std::uint64_t kTowns = 20;

RoadNetwork Town(std::uint64_t seed) {
  return MakeRoadNetwork(CampusRandom(seed));
}

PlaneLine Closed(const Path& path) {
  PlaneLine line = path.points;
  line.push_back(line.front());
  return line;
}

TEST(CampusRoadsTest, RoutesOfAllTownsAreBetween620And700Metres) {
  for (std::uint64_t seed = 0; seed < kTowns; ++seed) {
    const double length = LineLength(Closed(Town(seed).route));
    EXPECT_GT(length, 620.0) << "seed " << seed;
    EXPECT_LT(length, 700.0) << "seed " << seed;
  }
}

TEST(CampusRoadsTest, RoutesOfAllTownsCanBeDriven) {
  for (std::uint64_t seed = 0; seed < kTowns; ++seed) {
    const PlaneLine route = Town(seed).route.points;
    const std::size_t count = route.size();
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector2d before = route[i] - route[(i + count - 1) % count];
      const Eigen::Vector2d after = route[(i + 1) % count] - route[i];
      const double turn =
          std::atan2(before.x() * after.y() - before.y() * after.x(), before.dot(after));
      ASSERT_LT(std::abs(turn) / after.norm(), 1.0 / 6.0) << "seed " << seed;
    }
  }
}

TEST(CampusRoadsTest, RoutePassesJunctionsWithSideStreets) {
  for (std::uint64_t seed = 0; seed < kTowns; ++seed) {
    const RoadNetwork town = Town(seed);
    ASSERT_GE(town.junctions.size(), 4U);
    for (const Eigen::Vector2d& junction : town.junctions)
      EXPECT_LT(DistanceToLine(Closed(town.route), junction), 6.5) << "seed " << seed;
  }
}

TEST(CampusRoadsTest, ParkedCarsKeepClearOfTheRoute) {
  for (std::uint64_t seed = 0; seed < kTowns; ++seed) {
    const RoadNetwork town = Town(seed);
    const PlaneLine route = Closed(town.route);
    for (const ParkingSpot& spot : town.parking_spots) {
      for (const double along : {-2.9, 0.0, 2.9}) {
        const Eigen::Vector2d p_W = spot * Eigen::Vector2d(along, 0.0);
        EXPECT_GT(DistanceToLine(route, p_W), 2.0) << "seed " << seed << " " << spot;
      }
    }
  }
}

TEST(CampusRoadsTest, DistancesToARoadAreThoseToItsKerb) {
  RoadField field({-20, -20}, {60, 20});
  field.AddStrip(PlaneLine{{0.0, 0.0}, {40.0, 0.0}}, 3.5, 6.0);
  EXPECT_NEAR(field.DistanceAt({20.3, 0.0}), -3.5, 1e-9);
  EXPECT_NEAR(field.DistanceAt({20.3, 3.5}), 0.0, 1e-9);
  EXPECT_NEAR(field.DistanceAt({20.3, -7.25}), 3.75, 1e-9);
  EXPECT_EQ(field.DistanceAt({200.0, 0.0}), RoadField::kFarAway);
}

TEST(CampusRoadsTest, CornersOfJunctionsAreRoundedWithTheirRadius) {
  RoadField field({-30, -30}, {30, 30});
  field.AddStrip(PlaneLine{{-30.0, 0.0}, {30.0, 0.0}}, 3.0, 6.0);
  field.AddStrip(PlaneLine{{0.0, -30.0}, {0.0, 30.0}}, 3.0, 6.0);
  // The kerb is a circle round (9, 9), which touches both streets' kerbs.
  for (const double angle : {0.1, 0.5, 0.8, 1.4}) {
    const Eigen::Vector2d p_W =
        Eigen::Vector2d(9.0, 9.0) - 6.0 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    EXPECT_NEAR(field.DistanceAt(p_W), 0.0, 0.05) << angle;
  }
}

TEST(CampusRoadsTest, ContoursGoRoundTheRoadWithItOnTheirLeft) {
  RoadField field({-20, -20}, {60, 20});
  field.AddStrip(PlaneLine{{0.0, 0.0}, {40.0, 0.0}}, 3.5, 6.0);
  const std::vector<RoadContour> contours = field.Contours(0.0);
  ASSERT_EQ(contours.size(), 1U);
  EXPECT_TRUE(contours[0].is_closed);
  const PlaneLine& points = contours[0].points;
  double area = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d& a = points[i];
    const Eigen::Vector2d& b = points[(i + 1) % points.size()];
    area += 0.5 * (a.x() * b.y() - a.y() * b.x());
    EXPECT_NEAR(field.DistanceAt(a), 0.0, 1e-9);
  }
  EXPECT_NEAR(area, 40.0 * 7.0 + std::numbers::pi * 3.5 * 3.5, 1.0);
}

}  // namespace
}  // namespace relocd
