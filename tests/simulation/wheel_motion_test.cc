#include "simulation/wheel_motion.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulation/test_route.h"

namespace relocd {
namespace {

constexpr std::int64_t kPeriodNs = 10'000'000;
constexpr VehicleGeometry kGeometry{.track_m = 1.5, .wheelbase_m = 2.7};

DrivePlan Plan() {
  return DrivePlan::Create(OvalRoute(), Session(), {.seed = 2, .reverses_m = {60.0}}).value();
}

TEST(WheelMotionTest, RearWheelsTravelAsTheBodyMovesAndTurns) {
  const DrivePlan plan = Plan();
  const auto motions = RollWheels(plan, SlopedGround(0.0), kGeometry, kPeriodNs);
  ASSERT_GT(motions.size(), 3000U);
  for (const WheelMotion& motion : motions) {
    const DrivePlan::State state = plan.At(motion.time_ns);
    const double turn_m = 0.5 * kGeometry.track_m * (state.heading_rad - plan.At(0).heading_rad);
    ASSERT_NEAR(motion.travel_m[0], state.travel_m - turn_m, 1e-9);
    ASSERT_NEAR(motion.travel_m[1], state.travel_m + turn_m, 1e-9);
  }
}

/// Where a bend begins, the rate over two periods is a little off.
TEST(WheelMotionTest, SpeedsAreTheRateOfTravel) {
  for (const double slope : {0.0, 0.05}) {
    const auto motions = RollWheels(Plan(), SlopedGround(slope), kGeometry, kPeriodNs);
    for (std::size_t i = 1; i + 1 < motions.size(); ++i) {
      for (std::size_t wheel = 0; wheel < kWheels; ++wheel) {
        const double rate_mps =
            (motions[i + 1].travel_m.at(wheel) - motions[i - 1].travel_m.at(wheel)) / 0.02;
        ASSERT_NEAR(motions[i].speeds_mps.at(wheel), rate_mps, 3e-3) << i << " " << wheel;
      }
    }
  }
}

/// In a bend of a constant radius all wheels run on circles about the same point.
TEST(WheelMotionTest, FrontWheelsSteerAboutTheMiddleOfTheBend) {
  const DrivePlan plan = Plan();
  const auto motions = RollWheels(plan, SlopedGround(0.0), kGeometry, kPeriodNs);
  for (const WheelMotion& motion : motions) {
    const DrivePlan::State state = plan.At(motion.time_ns);
    if (state.curvature_per_m < 0.05) continue;
    const double radius_m = 1.0 / state.curvature_per_m;
    ASSERT_NEAR(std::tan(motion.steering_rad), kGeometry.wheelbase_m / radius_m, 1e-9);
    const double left_m = std::hypot(radius_m - 0.75, kGeometry.wheelbase_m);
    ASSERT_NEAR(motion.speeds_mps[2], state.speed_mps * left_m / radius_m, 3e-3);
    const double right_m = std::hypot(radius_m + 0.75, kGeometry.wheelbase_m);
    ASSERT_NEAR(motion.speeds_mps[3], state.speed_mps * right_m / radius_m, 3e-3);
  }
}

/// Wheels measure the way along the ground, of which a map seen from above shows less: on a slope
/// of 3 %, 0.045 % less.
TEST(WheelMotionTest, SlopesAreLongerThanTheyLookFromAbove) {
  Path route;
  for (int i = 0; i <= 50; ++i)
    route.points.emplace_back(2.0 * i, 0.0);
  Session session;
  session.lateral_sway_m = 0.0;
  const auto plan = DrivePlan::Create(route, session, {});
  ASSERT_TRUE(plan);
  const auto motions = RollWheels(*plan, SlopedGround(0.03), kGeometry, kPeriodNs);
  for (const double travel_m : motions.back().travel_m)
    EXPECT_NEAR(travel_m, 100.0 * std::hypot(1.0, 0.03), 1e-6);
}

TEST(WheelMotionTest, RollsBackwardsWhenReversing) {
  const auto motions = RollWheels(Plan(), SlopedGround(0.0), kGeometry, kPeriodNs);
  double least_mps = 0.0;
  for (const WheelMotion& motion : motions)
    least_mps = std::min(least_mps, motion.speeds_mps[2]);
  EXPECT_NEAR(least_mps, -1.5, 0.05);
}

}  // namespace
}  // namespace relocd
