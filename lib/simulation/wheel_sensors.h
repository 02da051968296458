#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <string>

#include "can/dbc.h"
#include "core/result.h"
#include "simulation/wheel_motion.h"

namespace relocd {

/// How a simulated vehicle's sensors, and what they are sent with, differ from perfect ones.
struct WheelSimulationOptions {
  std::uint64_t seed = 0;
  double rate_hz = 100.0;
  std::string interface = "can0";  ///< Of the frames.
  /// Each wheel's radius is off by a part drawn once, with this standard deviation.
  double radius_sigma = 0.0;
  /// White noise of each wheel's travel after one metre. Negative: as odometry's config has it.
  double wheel_sigma_m_per_sqrt_m = -1.0;
  double slips_per_m = 0.0;    ///< Mean number of slips of each wheel.
  double slip_sigma_m = 0.02;  ///< How far a wheel turns in vain in one.
  /// The part by which wheels turn further for each m/s^2 of acceleration, and less when braking.
  double traction_slip_per_mps2 = 0.0;
  /// The part by which the outer wheels turn further, and the inner ones less, for each m/s^2 of
  /// acceleration to the side.
  double turn_slip_per_mps2 = 0.0;
  double yaw_rate_bias_radps = 0.0;
  double yaw_rate_noise_radps = 0.0;  ///< Of each measurement.
  /// Used where the DBC file has them; in deg or deg/s if their unit says so, else in rad or rad/s.
  std::string steering_signal = "STEERING.ANGLE";
  std::string yaw_rate_signal = "INERTIAL.YAW_RATE";

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;

  /// Between two sets of frames; whole microseconds, which is what candump has.
  [[nodiscard]] std::int64_t period_ns() const;
};

/// What a vehicle's controller knows of its motion.
struct WheelReading {
  std::array<double, kWheels> travel_m{};  ///< Since it was switched on, with all errors.
  std::array<double, kWheels> speeds_mps{};
  double steering_rad = 0.0;
  double yaw_rate_radps = 0.0;
};

/// Measures what wheels do, with the errors that the options ask for.
class WheelSensors {
 public:
  /// @param wheel_sigma_m_per_sqrt_m  takes the place of a negative one in the options.
  WheelSensors(const WheelSimulationOptions& options, double wheel_sigma_m_per_sqrt_m);

  /// To be called with the motions in their order.
  WheelReading Measure(const WheelMotion& motion);

 private:
  /// The part by which a wheel turns further than it rolls.
  double SlipOf(std::size_t wheel, const WheelMotion& motion, double travel_m);
  double NoiseOf(double travel_m);

  WheelSimulationOptions options_;
  double sigma_;
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
  std::array<double, kWheels> scale_{};
  std::array<double, kWheels> grip_{};  ///< Slow random changes of slip, of variance 1.
  std::optional<WheelMotion> last_;
  WheelReading reading_;
};

}  // namespace relocd
