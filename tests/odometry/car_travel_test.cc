#include "odometry/car_travel.h"

#include <cmath>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

/// What the wheels, the steering and a gyro measure of a motion without error.
CarMeasurement Perfect(const DifferentialDriveConfig& drive, double forward_m, double turn_rad) {
  const double half_m = 0.5 * drive.track_m;
  const auto front = [&](double y_m) {
    const double along_m = forward_m - y_m * turn_rad;
    return std::copysign(std::hypot(along_m, drive.wheelbase_m * turn_rad), along_m);
  };
  CarMeasurement measured;
  measured.rear.travel_m = {forward_m - half_m * turn_rad, forward_m + half_m * turn_rad};
  measured.rear.duration_s = 0.01;
  measured.front_m = Eigen::Vector2d(front(half_m), front(-half_m));
  measured.steering_rad = std::atan(drive.wheelbase_m * turn_rad / forward_m);
  measured.turn = TurnMeasurement{.turn_rad = turn_rad, .variance_rad2 = 1e-6};
  return measured;
}

TEST(CarTravelTest, FindsTheMotionThatAllMeasureWithoutError) {
  TestRandom random(1);
  const DifferentialDriveConfig drive{.track_m = 1.6, .wheelbase_m = 2.7};
  for (int i = 0; i < 1000; ++i) {
    const double forward_m = random.Uniform(0.05, 0.5) * (i % 2 == 0 ? 1.0 : -1.0);
    const double turn_rad = forward_m * random.Uniform(-0.2, 0.2);
    const BodyTravel travel = SolveCarTravel(drive, Perfect(drive, forward_m, turn_rad));
    EXPECT_NEAR(travel.forward_m, forward_m, 1e-9);
    EXPECT_NEAR(travel.turn_rad, turn_rad, 1e-9);
    EXPECT_LT(travel.worst_residual, 1e-4);
  }
}

TEST(CarTravelTest, IsTheRearAxleAndTheSteeringWithoutTheWheelsDifference) {
  const DifferentialDriveConfig drive{.track_m = 1.6, .wheelbase_m = 2.5};
  CarMeasurement measured;
  measured.rear.travel_m = {0.9, 1.1};
  measured.uses_rear_difference = false;
  measured.steering_rad = std::atan(0.25);
  const BodyTravel travel = SolveCarTravel(drive, measured);
  EXPECT_NEAR(travel.forward_m, 1.0, 1e-6);
  EXPECT_NEAR(travel.turn_rad, 0.1, 1e-6);
  // The steering's sigma over one metre: (1 + tan^2) / wheelbase.
  EXPECT_NEAR(std::sqrt(travel.covariance(1, 1)), 1.0625 / 2.5 * 0.01, 2e-4);
}

TEST(CarTravelTest, IsTheSameAsTheDifferentialDriveOfTwoWheels) {
  TestRandom random(2);
  const DifferentialDriveConfig drive{.track_m = 1.6};
  for (int i = 0; i < 100; ++i) {
    CarMeasurement measured;
    measured.rear = {.travel_m = {random.Uniform(0.1, 0.3), random.Uniform(0.1, 0.3)},
                     .duration_s = 0.01};
    const BodyMotion expected = MotionFromTravel(drive, measured.rear);
    const BodyMotion motion =
        MotionFromBodyTravel(drive, SolveCarTravel(drive, measured), measured.rear.duration_s);
    EXPECT_THAT(motion.X_BiBj.Log(), IsNear(expected.X_BiBj.Log(), 1e-9));
    EXPECT_NEAR(
        (motion.covariance - expected.covariance).norm(), 0.0, 1e-4 * expected.covariance.norm());
  }
}

/// Over many draws the error is as large as the covariance says, and four wheels with a gyro are
/// better than two.
TEST(CarTravelTest, HasAnHonestCovariance) {
  TestRandom random(3);
  const DifferentialDriveConfig drive{.track_m = 1.6, .wheel_sigma_m_per_sqrt_m = 0.01};
  constexpr int kDraws = 3000;
  double squared = 0.0;
  double two_wheels = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    CarMeasurement measured = Perfect(drive, 0.2, 0.01);
    for (double* travel_m : {&measured.rear.travel_m[0],
                             &measured.rear.travel_m[1],
                             &(*measured.front_m)[0],
                             &(*measured.front_m)[1]}) {
      *travel_m += random.Normal(drive.wheel_sigma_m_per_sqrt_m * std::sqrt(0.2));
    }
    measured.turn->turn_rad += random.Normal(1e-3);
    measured.steering_rad.reset();
    const BodyTravel travel = SolveCarTravel(drive, measured);
    const Eigen::Vector2d error(travel.forward_m - 0.2, travel.turn_rad - 0.01);
    squared += error.dot(travel.covariance.inverse() * error);
    measured.turn.reset();
    measured.front_m.reset();
    two_wheels += SolveCarTravel(drive, measured).covariance(1, 1) / travel.covariance(1, 1);
  }
  EXPECT_NEAR(squared / kDraws, 2.0, 0.12);
  EXPECT_GT(two_wheels / kDraws, 10.0);
}

TEST(CarTravelTest, OneSpinningWheelCountsLittleAndShows) {
  const DifferentialDriveConfig drive{.track_m = 1.6, .wheel_sigma_m_per_sqrt_m = 0.004};
  CarMeasurement measured = Perfect(drive, 0.2, 0.0);
  measured.rear.travel_m[1] += 0.05;
  const BodyTravel travel = SolveCarTravel(drive, measured);
  EXPECT_GT(travel.worst_residual, 10.0);
  EXPECT_NEAR(travel.forward_m, 0.2, 0.005);
  EXPECT_NEAR(travel.turn_rad, 0.0, 0.002);
}

}  // namespace
}  // namespace relocd
