#include "simulation/drive_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulation/test_route.h"

namespace relocd {
namespace {

constexpr std::int64_t kMillisecondNs = 1'000'000;

Session Calm() {
  Session session;
  session.lateral_sway_m = 0.0;
  return session;
}

DrivePlan Plan(const Session& session, const DrivePlanOptions& options) {
  auto plan = DrivePlan::Create(OvalRoute(), session, options);
  EXPECT_TRUE(plan) << plan.error().message;
  return std::move(plan).value();
}

/// A drive with everything that a drive may have, other for each seed.
DrivePlan LivelyPlan(std::uint64_t seed) {
  Session session;
  session.lateral_sway_m = 0.5;
  session.lateral_offset_m = seed % 2 == 0 ? 1.0 : -1.0;
  session.speed_factor = 1.4;
  return Plan(session, {.seed = seed, .begin_m = 10.0, .stops_m = {60.0}, .reverses_m = {140.0}});
}

class DrivePlanTest : public testing::TestWithParam<int> {
 protected:
  const DrivePlan plan_ = LivelyPlan(static_cast<std::uint64_t>(GetParam()));
};

/// Over a step the body moves along an arc whose direction in the middle is the mean heading.
TEST_P(DrivePlanTest, NeverMovesSideways) {
  for (std::int64_t time_ns = 0; time_ns < plan_.duration_ns(); time_ns += 10 * kMillisecondNs) {
    const DrivePlan::State from = plan_.At(time_ns);
    const DrivePlan::State to = plan_.At(time_ns + 10 * kMillisecondNs);
    const double heading_rad = 0.5 * (from.heading_rad + to.heading_rad);
    const Eigen::Vector2d moved = to.X_WB.translation() - from.X_WB.translation();
    const Eigen::Vector2d left(-std::sin(heading_rad), std::cos(heading_rad));
    ASSERT_NEAR(moved.dot(left), 0.0, 2e-6) << "at " << time_ns;
    const Eigen::Vector2d ahead(std::cos(heading_rad), std::sin(heading_rad));
    ASSERT_NEAR(moved.dot(ahead), to.travel_m - from.travel_m, 2e-6) << "at " << time_ns;
  }
}

TEST_P(DrivePlanTest, KeepsItsLimits) {
  const DrivePlanOptions limits;
  for (std::int64_t time_ns = 0; time_ns < plan_.duration_ns(); time_ns += 10 * kMillisecondNs) {
    const DrivePlan::State state = plan_.At(time_ns);
    ASSERT_LE(state.speed_mps, 1.4 * limits.speed_mps + 1e-9);
    ASSERT_GE(state.speed_mps, -limits.limits.reverse_speed_mps - 1e-9);
    ASSERT_LE(std::abs(state.lateral_acceleration_mps2()),
              limits.lateral_acceleration_mps2 * 1.005);
    ASSERT_LE(std::abs(state.acceleration_mps2), limits.limits.braking_mps2 + 1e-9);
  }
}

TEST_P(DrivePlanTest, VelocityAndAccelerationDoNotJump) {
  const double step_s = 1e-3;
  double least_speed_mps = 0.0;
  for (std::int64_t time_ns = 0; time_ns < plan_.duration_ns(); time_ns += 7 * kMillisecondNs) {
    const DrivePlan::State before = plan_.At(time_ns - kMillisecondNs);
    const DrivePlan::State at = plan_.At(time_ns);
    const DrivePlan::State after = plan_.At(time_ns + kMillisecondNs);
    ASSERT_NEAR((after.travel_m - before.travel_m) / (2.0 * step_s), at.speed_mps, 1e-5);
    ASSERT_NEAR((after.speed_mps - before.speed_mps) / (2.0 * step_s), at.acceleration_mps2, 6e-3);
    // Not more than the jerk that smoothing leaves.
    ASSERT_NEAR(after.acceleration_mps2, at.acceleration_mps2, 6.0 * step_s);
    ASSERT_NEAR(after.curvature_per_m, at.curvature_per_m, 1e-3);
    least_speed_mps = std::min(least_speed_mps, at.speed_mps);
  }
  EXPECT_LT(least_speed_mps, -1.0) << "did not reverse";
}

TEST_P(DrivePlanTest, StandsAtBeginAndEnd) {
  const std::int64_t second_ns = 1000 * kMillisecondNs;
  EXPECT_EQ(plan_.At(0).travel_m, plan_.At(second_ns).travel_m);
  const DrivePlan::State end = plan_.At(plan_.duration_ns());
  EXPECT_NEAR(plan_.At(plan_.duration_ns() - second_ns).travel_m, end.travel_m, 1e-9);
  EXPECT_NEAR(end.travel_m, plan_.length_m(), 1e-9);
  EXPECT_GT(plan_.At(3 * second_ns).travel_m, 0.1);
}

INSTANTIATE_TEST_SUITE_P(Seeds, DrivePlanTest, testing::Range(0, 6));

TEST(DrivePlanRouteTest, ClosesTheLoop) {
  const DrivePlan plan = Plan(Calm(), {.begin_m = 30.0});
  const DrivePlan::State begin = plan.At(0);
  const DrivePlan::State end = plan.At(plan.duration_ns());
  EXPECT_LT((begin.X_WB.translation() - end.X_WB.translation()).norm(), 1e-6);
  EXPECT_NEAR(end.heading_rad - begin.heading_rad, 2.0 * std::numbers::pi, 1e-6);
  EXPECT_NEAR(plan.length_m(), OvalLength_m(), 0.01 * OvalLength_m());
}

TEST(DrivePlanRouteTest, DrivesAsManyLapsAsAsked) {
  const double one_m = Plan(Calm(), {}).length_m();
  EXPECT_NEAR(Plan(Calm(), {.laps = 3}).length_m(), 3.0 * one_m, 1e-6);
  EXPECT_NEAR(Plan(Calm(), {.begin_m = 20.0, .end_m = 70.0}).length_m(), 50.0, 0.1);
  EXPECT_NEAR(
      Plan(Calm(), {.begin_m = 70.0, .end_m = 20.0}).length_m(), OvalLength_m() - 50.0, 0.5);
}

TEST(DrivePlanRouteTest, KeepsTheSessionsOffset) {
  Session session = Calm();
  session.lateral_offset_m = -1.0;
  const DrivePlan plan = Plan(session, {});
  double farthest_m = 0.0;
  for (std::int64_t time_ns = 0; time_ns < plan.duration_ns(); time_ns += 100 * kMillisecondNs) {
    const Eigen::Vector2d p_W = plan.At(time_ns).X_WB.translation();
    // The right side of a drive to the left is outside; the oval is 12 m from its middle line.
    const double beyond_m = std::max(0.0, std::abs(p_W.x()) - 40.0);
    farthest_m = std::max(farthest_m, std::abs(std::hypot(beyond_m, p_W.y()) - 13.0));
  }
  EXPECT_LT(farthest_m, 0.06);
}

TEST(DrivePlanRouteTest, SwaysAsFarAsTheSessionSays) {
  Session session = Calm();
  session.lateral_sway_m = 0.5;
  const DrivePlan plan = Plan(session, {.seed = 3});
  double left_m = 0.0;
  double right_m = 0.0;
  for (std::int64_t time_ns = 0; time_ns < plan.duration_ns(); time_ns += 100 * kMillisecondNs) {
    const Eigen::Vector2d p_W = plan.At(time_ns).X_WB.translation();
    const double beyond_m = std::max(0.0, std::abs(p_W.x()) - 40.0);
    const double off_m = 12.0 - std::hypot(beyond_m, p_W.y());
    left_m = std::max(left_m, off_m);
    right_m = std::max(right_m, -off_m);
  }
  EXPECT_GT(left_m, 0.2);
  EXPECT_LT(left_m, 0.56);
  EXPECT_GT(right_m, 0.2);
  EXPECT_LT(right_m, 0.56);
}

TEST(DrivePlanRouteTest, StopsWhereAskedOnEachLap) {
  const DrivePlan plan = Plan(Calm(), {.laps = 2, .stops_m = {50.0}, .stop_s = 4.0});
  std::vector<double> stops_m;
  std::vector<double> stops_s;
  bool was_standing = true;
  for (std::int64_t time_ns = 0; time_ns < plan.duration_ns(); time_ns += 10 * kMillisecondNs) {
    const DrivePlan::State state = plan.At(time_ns);
    const bool stands = std::abs(state.speed_mps) < 1e-9;
    if (stands && !was_standing) {
      stops_m.push_back(state.travel_m);
      stops_s.push_back(0.0);
    }
    if (stands && !stops_s.empty()) stops_s.back() += 0.01;
    was_standing = stands;
  }
  ASSERT_EQ(stops_m.size(), 3U);  // the last is the end
  EXPECT_NEAR(stops_m[0], 50.0, 0.3);
  EXPECT_NEAR(stops_m[1], 50.0 + 0.5 * plan.length_m(), 0.3);
  EXPECT_GT(stops_s[0], 4.0 * 0.5 - SpeedProfile::kSmoothingS);
  EXPECT_LT(stops_s[0], 4.0 * 1.5);
}

TEST(DrivePlanRouteTest, ReversesAsFarAsAsked) {
  const DrivePlan plan = Plan(Calm(), {.reverses_m = {60.0}, .reverse_m = 4.0});
  double farthest_m = 0.0;
  double back_m = 0.0;
  for (std::int64_t time_ns = 0; time_ns < plan.duration_ns(); time_ns += 10 * kMillisecondNs) {
    const DrivePlan::State state = plan.At(time_ns);
    farthest_m = std::max(farthest_m, state.travel_m);
    back_m = std::max(back_m, farthest_m - state.travel_m);
  }
  EXPECT_NEAR(back_m, 4.0, 1e-6);
  EXPECT_NEAR(farthest_m, plan.length_m(), 1e-6);
}

TEST(DrivePlanRouteTest, DrivesAnOpenRouteFromEndToEnd) {
  Path route;
  for (int i = 0; i <= 20; ++i)
    route.points.emplace_back(4.0 * i, 0.002 * i * i * i);
  const auto plan = DrivePlan::Create(route, Calm(), {});
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_LT((plan->At(0).X_WB.translation() - route.points.front()).norm(), 0.02);
  EXPECT_LT((plan->At(plan->duration_ns()).X_WB.translation() - route.points.back()).norm(), 0.02);
}

TEST(DrivePlanRouteTest, TheSeedDecides) {
  const std::int64_t time_ns = 20'000 * kMillisecondNs;
  const Session session;
  const double first_m = Plan(session, {.seed = 1}).At(time_ns).X_WB.y();
  EXPECT_EQ(first_m, Plan(session, {.seed = 1}).At(time_ns).X_WB.y());
  EXPECT_NE(first_m, Plan(session, {.seed = 2}).At(time_ns).X_WB.y());
}

TEST(DrivePlanErrorsTest, NamesWhatIsWrong) {
  const auto error_of = [](const Path& route, const DrivePlanOptions& options) {
    const auto plan = DrivePlan::Create(route, Session(), options);
    return plan ? std::string() : plan.error().message;
  };
  const Path oval = OvalRoute();
  EXPECT_EQ(error_of(Path(), {}), "the route has 0 points, must have at least 3");
  EXPECT_EQ(error_of(oval, {.speed_mps = 0.0}), "speed_mps is 0, must be in [0.1, 50]");
  EXPECT_EQ(error_of(oval, {.laps = 0}), "laps is 0, must be in [1, 100]");
  EXPECT_THAT(error_of(oval, {.begin_m = 1e4}), testing::HasSubstr("must be on the route"));
  EXPECT_THAT(error_of(oval, {.stops_m = {-1.0}}), testing::HasSubstr("a stop at -1 m, must be"));
  Path open = oval;
  open.is_closed = false;
  EXPECT_EQ(error_of(open, {.laps = 2}), "laps is 2, must be 1 on a route that does not close");
  Path sharp{.points = {{0.0, 0.0}, {10.0, 0.0}, {10.5, 0.5}, {0.0, 0.5}}, .is_closed = false};
  EXPECT_THAT(error_of(sharp, {}), testing::HasSubstr("turns with a radius of"));
}

}  // namespace
}  // namespace relocd
