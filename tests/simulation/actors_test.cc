#include "simulation/actors.h"

#include <cmath>

#include <gtest/gtest.h>

#include "simulation/test_world.h"

namespace relocd {
namespace {

Session Busy() {
  Session session;
  session.cars_per_km = 25.0;
  session.pedestrians_per_km = 40.0;
  return session;
}

TEST(ParkedCarsTest, TakeThePartOfTheSpotsThatIsAskedFor) {
  const World world = StraightWorld();
  Session session;
  session.parked_part = 0.0;
  EXPECT_TRUE(ParkedCars(world, session).empty());
  session.parked_part = 1.0;
  EXPECT_EQ(ParkedCars(world, session).size(), world.parking_spots.size());
  session.parked_part = 0.5;
  double sum = 0.0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    session.parked_seed = seed;
    sum += static_cast<double>(ParkedCars(world, session).size());
  }
  EXPECT_NEAR(sum / (100.0 * 30.0), 0.5, 0.03);
}

TEST(ParkedCarsTest, StandNearlyStraightInTheirSpotsOnTheGround) {
  World world = StraightWorld();
  constexpr double kSlope = 0.03;
  world.ground = std::make_shared<SlopedGround>(kSlope);
  Session session;
  session.parked_part = 1.0;
  const auto cars = ParkedCars(world, session);
  for (std::size_t i = 0; i < cars.size(); ++i) {
    const Eigen::Vector3f at = cars[i].X_WM.translation();
    EXPECT_LT((at.head<2>().cast<double>() - world.parking_spots[i].translation()).norm(), 0.3);
    EXPECT_NEAR(at.z(), kSlope * at.x(), 0.01);
    const Eigen::Vector3f ahead = cars[i].X_WM.linear().col(0);
    EXPECT_NEAR(std::atan2(ahead.z(), ahead.x()), std::atan(kSlope), 2e-3);
    EXPECT_LT(std::abs(ahead.y()), 0.05);
  }
}

TEST(ParkedCarsTest, AWorldWithoutCarsHasNone) {
  World world = StraightWorld();
  world.car_meshes.clear();
  EXPECT_TRUE(ParkedCars(world, Session{}).empty());
}

TEST(MovingActorsTest, AreAsManyAsAskedForPerKilometre) {
  const World world = StraightWorld();
  const MovingActors actors(world, Busy(), 3);
  // 0.2 km of road and of walkway: five cars and eight people.
  EXPECT_NEAR(static_cast<double>(actors.size()), 13.0, 2.0);
  EXPECT_EQ(MovingActors(world, Session{}, 3).size(), 0U);
}

TEST(MovingActorsTest, MoveSteadilyAlongTheirPathsFacingAhead) {
  const World world = StraightWorld();
  const MovingActors actors(world, Busy(), 3);
  for (double time_s = 0.0; time_s < 60.0; time_s += 0.37) {
    constexpr double kStepS = 0.02;
    for (const MovingMesh& mover : actors.During(time_s, time_s + kStepS)) {
      const Eigen::Vector3f begin = mover.X_WM_begin.translation();
      const Eigen::Vector3f step = mover.X_WM_end.translation() - begin;
      if (step.norm() > 10.0F) continue;  // from the path's end back to its begin
      const bool is_car = mover.mesh == world.car_meshes[0];
      EXPECT_NEAR(step.norm() / kStepS, is_car ? 7.0 : 1.4, is_car ? 0.05 : 0.4);
      EXPECT_GT(mover.X_WM_begin.linear().col(0).dot(step.normalized()), 0.99F);
      EXPECT_NEAR(begin.y(), is_car ? 1.5 : 5.0, is_car ? 0.01 : 0.5);
      EXPECT_NEAR(begin.z(), 0.0, 1e-4);
    }
  }
}

TEST(MovingActorsTest, GoRoundClosedPathsWithoutAJump) {
  World world = StraightWorld();
  world.walkways.clear();
  Path ring;
  ring.is_closed = true;
  for (int i = 0; i < 60; ++i)
    ring.points.emplace_back(20.0 * std::cos(i * 0.1047198), 20.0 * std::sin(i * 0.1047198));
  world.traffic = {ring};
  const MovingActors actors(world, Busy(), 5);
  ASSERT_GT(actors.size(), 0U);
  for (double time_s = 0.0; time_s < 60.0; time_s += 0.1) {
    for (const MovingMesh& mover : actors.During(time_s, time_s + 0.1)) {
      const Eigen::Vector3f step = mover.X_WM_end.translation() - mover.X_WM_begin.translation();
      EXPECT_NEAR(step.norm(), 0.7, 0.02);
    }
  }
}

}  // namespace
}  // namespace relocd
