#include "simulation/vehicle_body.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/planar.h"
#include "simulation/test_route.h"

namespace relocd {
namespace {

constexpr std::int64_t kStepNs = 20'000'000;
constexpr VehicleBodyOptions kStiff{
    .roughness = 0.0, .pitch_rad_per_mps2 = 0.0, .roll_rad_per_mps2 = 0.0};

DrivePlan Plan() {
  return DrivePlan::Create(OvalRoute(), Session(), {.laps = 2, .stops_m = {40.0}}).value();
}

/// Of the body's x axis above, and of its y axis above the horizon.
double NoseUp(const Pose3& X_WB) {
  return std::asin(X_WB.R()(2, 0));
}
double LeftUp(const Pose3& X_WB) {
  return std::asin(X_WB.R()(2, 1));
}

TEST(VehicleBodyTest, LiesFlatOnFlatGround) {
  const DrivePlan plan = Plan();
  const SlopedGround ground(0.0);
  const VehicleBody body(plan, ground, {}, kStiff);
  for (std::int64_t time_ns = 0; time_ns < plan.duration_ns(); time_ns += kStepNs) {
    const Pose3 error = LiftFromPlane(plan.At(time_ns).X_WB).Inverse() * body.At(time_ns);
    ASSERT_LT(error.Log().norm(), 1e-9);
  }
}

TEST(VehicleBodyTest, SeenFromAboveItIsThePlan) {
  const DrivePlan plan = Plan();
  const SlopedGround ground(0.03);
  const VehicleBody body(plan, ground, {}, {.seed = 4, .roughness = 5.0});
  for (std::int64_t time_ns = 0; time_ns < plan.duration_ns(); time_ns += kStepNs) {
    const Pose2 error = plan.At(time_ns).X_WB.Inverse() * ProjectToPlane(body.At(time_ns));
    ASSERT_LT(error.Log().norm(), 1e-9);
  }
}

TEST(VehicleBodyTest, LiesAsTheSlopeDoes) {
  const DrivePlan plan = Plan();
  const double slope = 0.03;
  const SlopedGround ground(slope);
  const VehicleBody body(plan, ground, {}, kStiff);
  for (std::int64_t time_ns = 0; time_ns < plan.duration_ns(); time_ns += kStepNs) {
    const Pose3 X_WB = body.At(time_ns);
    ASSERT_NEAR(X_WB.translation().z(), slope * X_WB.translation().x(), 1e-9);
    const double heading_rad = plan.At(time_ns).heading_rad;
    ASSERT_NEAR(std::tan(NoseUp(X_WB)), slope * std::cos(heading_rad), 1e-9);
    ASSERT_NEAR(LeftUp(X_WB), -slope * std::sin(heading_rad), 3e-5);
  }
}

TEST(VehicleBodyTest, NoseRisesWhenAcceleratingAndLeansOutOfBends) {
  const DrivePlan plan = Plan();
  const SlopedGround ground(0.0);
  const VehicleBody body(plan, ground, {}, {.roughness = 0.0});
  double highest_rad = 0.0;
  double lowest_rad = 0.0;
  double leaning_rad = 0.0;
  for (std::int64_t time_ns = 0; time_ns < plan.duration_ns(); time_ns += kStepNs) {
    const DrivePlan::State state = plan.At(time_ns);
    const Pose3 X_WB = body.At(time_ns);
    ASSERT_NEAR(NoseUp(X_WB), 0.006 * state.acceleration_mps2, 1e-9);
    highest_rad = std::max(highest_rad, NoseUp(X_WB));
    lowest_rad = std::min(lowest_rad, NoseUp(X_WB));
    leaning_rad = std::max(leaning_rad, LeftUp(X_WB));
  }
  EXPECT_GT(highest_rad, 0.006 * 1.1);
  EXPECT_LT(lowest_rad, -0.006 * 1.5);
  EXPECT_GT(leaning_rad, 0.006 * 1.5);  // the oval's bends are all to the left
}

TEST(VehicleBodyTest, RoughGroundShakesItAsAsked) {
  const DrivePlan plan = Plan();
  const SlopedGround ground(0.0);
  VehicleBodyOptions options = kStiff;
  for (const double roughness : {1.0, 5.0}) {
    options.roughness = roughness;
    const VehicleBody body(plan, ground, {}, options);
    double pitch_sum = 0.0;
    double roll_sum = 0.0;
    int count = 0;
    for (std::int64_t time_ns = 0; time_ns < plan.duration_ns(); time_ns += kStepNs) {
      if (std::abs(plan.At(time_ns).speed_mps) < 1.0) continue;
      const Pose3 X_WB = body.At(time_ns);
      pitch_sum += std::pow(NoseUp(X_WB), 2.0);
      roll_sum += std::pow(LeftUp(X_WB), 2.0);
      ++count;
    }
    const double wanted_rad = roughness * 0.4 * std::numbers::pi / 180.0;
    EXPECT_NEAR(std::sqrt(pitch_sum / count), wanted_rad, 0.1 * wanted_rad);
    EXPECT_NEAR(std::sqrt(roll_sum / count), wanted_rad, 0.1 * wanted_rad);
  }
}

TEST(VehicleBodyTest, DoesNotShakeWhileItStands) {
  const DrivePlan plan = Plan();
  const SlopedGround ground(0.02);
  const VehicleBody body(plan, ground, {}, {.roughness = 10.0});
  const Pose3 error = body.At(0).Inverse() * body.At(900'000'000);
  EXPECT_LT(error.Log().norm(), 1e-9);
}

TEST(VehicleBodyTest, NamesWhatIsWrong) {
  const auto ok = VehicleBodyOptions{.roughness = -1.0}.Validate();
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().message, "roughness is -1, must be in [0, 20]");
}

}  // namespace
}  // namespace relocd
