#include "odometry/car_travel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/LU>

namespace relocd {
namespace {

/// Two rear and two front wheels, the steering, the yaw rate.
constexpr std::size_t kMostMeasurements = 6;
/// Within so many standard deviations a measurement counts in full.
constexpr double kHuber = 3.0;
/// So that nothing divides by the noise of a wheel that stands.
constexpr double kLeastWheelVariance = 1e-12;
constexpr double kLeastTurnVariance = 1e-14;

double Square(double value) {
  return value * value;
}

double SteeringTangent(const CarMeasurement& measured) {
  return std::tan(std::clamp(*measured.steering_rad, -1.4, 1.4));
}

double SteeredCurvature(const DifferentialDriveConfig& drive, const CarMeasurement& measured) {
  return SteeringTangent(measured) / drive.wheelbase_m;
}

/// What one measurement says of (forward, turn), to first order.
struct Equation {
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
  double residual = 0.0;  ///< Measured less expected.
  double variance = 1.0;
};

/// The equations at one estimate.
class Equations {
 public:
  Equations(const DifferentialDriveConfig& drive,
            const CarMeasurement& measured,
            const Eigen::Vector2d& estimate)
      : drive_(drive), measured_(measured), forward_m_(estimate[0]), turn_rad_(estimate[1]) {
    AddRear();
    if (measured.front_m) AddFront();
    if (measured.steering_rad) AddSteering();
    if (measured.turn) {
      Add({.gradient = {0.0, 1.0},
           .residual = measured.turn->turn_rad - turn_rad_,
           .variance = measured.turn->variance_rad2 + kLeastTurnVariance});
    }
  }

  [[nodiscard]] const Equation* begin() const { return all_.data(); }
  [[nodiscard]] const Equation* end() const { return all_.data() + size_; }

 private:
  void Add(const Equation& equation) { all_.at(size_++) = equation; }

  [[nodiscard]] double WheelVariance(double travel_m, double extra_m2) const {
    return Square(drive_.wheel_sigma_m_per_sqrt_m) * std::abs(travel_m) + extra_m2 +
           kLeastWheelVariance;
  }

  void AddRear() {
    const Eigen::Vector2d& travel_m = measured_.rear.travel_m;
    const Eigen::Vector2d variance(WheelVariance(travel_m[0], measured_.rear.variance_m2[0]),
                                   WheelVariance(travel_m[1], measured_.rear.variance_m2[1]));
    const double half_m = 0.5 * drive_.track_m;
    if (!measured_.uses_rear_difference) {
      return Add({.gradient = {1.0, 0.0},
                  .residual = travel_m.mean() - forward_m_,
                  .variance = variance.sum() / 4.0});
    }
    Add({.gradient = {1.0, -half_m},
         .residual = travel_m[0] - (forward_m_ - half_m * turn_rad_),
         .variance = variance[0]});
    Add({.gradient = {1.0, half_m},
         .residual = travel_m[1] - (forward_m_ + half_m * turn_rad_),
         .variance = variance[1]});
  }

  /// A front wheel rolls where it is steered to: the length of its contact point's way.
  void AddFront() {
    for (Eigen::Index i = 0; i < 2; ++i) {
      const double y_m = (i == 0 ? 0.5 : -0.5) * drive_.track_m;
      const double along_m = forward_m_ - y_m * turn_rad_;
      const double across_m = drive_.wheelbase_m * turn_rad_;
      const double length_m = std::hypot(along_m, across_m);
      if (length_m < 1e-9) continue;
      const double sign = along_m < 0.0 ? -1.0 : 1.0;
      const double turn_gradient = (-y_m * along_m + drive_.wheelbase_m * across_m) / length_m;
      const double travel_m = (*measured_.front_m)[i];
      Add({.gradient = {sign * along_m / length_m, sign * turn_gradient},
           .residual = travel_m - sign * length_m,
           .variance = WheelVariance(travel_m, measured_.rear.variance_m2.maxCoeff())});
    }
  }

  void AddSteering() {
    const TurnMeasurement turn = TurnBySteering(drive_, measured_, forward_m_);
    Add({.gradient = {-SteeredCurvature(drive_, measured_), 1.0},
         .residual = turn.turn_rad - turn_rad_,
         .variance = turn.variance_rad2});
  }

  const DifferentialDriveConfig& drive_;
  const CarMeasurement& measured_;
  double forward_m_;
  double turn_rad_;
  std::array<Equation, kMostMeasurements> all_{};
  std::size_t size_ = 0;
};

}  // namespace

TurnMeasurement TurnBySteering(const DifferentialDriveConfig& drive,
                               const CarMeasurement& measured,
                               double forward_m) {
  const double slope = (1.0 + Square(SteeringTangent(measured))) / drive.wheelbase_m;
  // The angle's error lasts for about a metre, so that over less it is not averaged.
  const double effective_m2 = std::abs(forward_m) * std::max(std::abs(forward_m), 1.0);
  return {.turn_rad = SteeredCurvature(drive, measured) * forward_m,
          .variance_rad2 =
              Square(slope * measured.steering_sigma_rad) * effective_m2 + kLeastTurnVariance};
}

BodyTravel SolveCarTravel(const DifferentialDriveConfig& drive, const CarMeasurement& measured) {
  const Eigen::Vector2d& rear_m = measured.rear.travel_m;
  Eigen::Vector2d estimate(rear_m.mean(), (rear_m[1] - rear_m[0]) / drive.track_m);
  if (measured.turn) estimate[1] = measured.turn->turn_rad;
  constexpr int kIterations = 6;
  BodyTravel travel;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    travel.worst_residual = 0.0;
    for (const Equation& equation : Equations(drive, measured, estimate)) {
      const double deviation = std::abs(equation.residual) / std::sqrt(equation.variance);
      travel.worst_residual = std::max(travel.worst_residual, deviation);
      const double weight = (deviation > kHuber ? kHuber / deviation : 1.0) / equation.variance;
      information += weight * equation.gradient * equation.gradient.transpose();
      gradient += weight * equation.gradient * equation.residual;
    }
    // Without any measurement of the turn it is taken to be none.
    constexpr double kLeastInformation = 1e-6;
    information(1, 1) += kLeastInformation;
    gradient[1] -= kLeastInformation * estimate[1];
    travel.covariance = information.inverse();
    estimate += travel.covariance * gradient;
  }
  travel.forward_m = estimate[0];
  travel.turn_rad = estimate[1];
  return travel;
}

BodyMotion MotionFromBodyTravel(const DifferentialDriveConfig& drive,
                                const BodyTravel& travel,
                                double duration_s) {
  const Eigen::Vector3d tangent(travel.forward_m, 0.0, travel.turn_rad);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  covariance(0, 0) = travel.covariance(0, 0);
  covariance(0, 2) = covariance(2, 0) = travel.covariance(0, 1);
  covariance(2, 2) = travel.covariance(1, 1);
  return MotionFromTwist(drive, tangent, covariance, duration_s);
}

}  // namespace relocd
