#include "simulation/wheel_sensors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <fmt/format.h>

namespace relocd {

Result<void> WheelSimulationOptions::Validate() const {
  struct Field {
    const char* name;
    double value;
    double low;
    double high;
  };
  for (const Field& field : {Field{"rate_hz", rate_hz, 1.0, 1000.0},
                             Field{"radius_sigma", radius_sigma, 0.0, 0.2},
                             Field{"wheel_sigma", wheel_sigma_m_per_sqrt_m, -1e3, 10.0},
                             Field{"slips_per_m", slips_per_m, 0.0, 100.0},
                             Field{"slip_sigma_m", slip_sigma_m, 0.0, 10.0},
                             Field{"traction_slip", traction_slip_per_mps2, 0.0, 0.1},
                             Field{"turn_slip", turn_slip_per_mps2, 0.0, 0.1},
                             Field{"yaw_rate_bias_radps", yaw_rate_bias_radps, -1.0, 1.0},
                             Field{"yaw_rate_noise_radps", yaw_rate_noise_radps, 0.0, 1.0}}) {
    if (!(field.value >= field.low && field.value <= field.high)) {
      return Error{
          ErrorKind::kInvalidInput,
          fmt::format(
              "{} is {}, must be in [{}, {}]", field.name, field.value, field.low, field.high)};
    }
  }
  return {};
}

std::int64_t WheelSimulationOptions::period_ns() const {
  return static_cast<std::int64_t>(std::llround(1e6 / rate_hz)) * 1000;
}

WheelSensors::WheelSensors(const WheelSimulationOptions& options, double wheel_sigma_m_per_sqrt_m)
    : options_(options),
      sigma_(options.wheel_sigma_m_per_sqrt_m < 0.0 ? wheel_sigma_m_per_sqrt_m
                                                    : options.wheel_sigma_m_per_sqrt_m),
      engine_(options.seed) {
  for (std::size_t i = 0; i < kWheels; ++i) {
    scale_.at(i) = 1.0 + options_.radius_sigma * normal_(engine_);
    grip_.at(i) = normal_(engine_);
    // Controllers were on for a while before a recording begins.
    reading_.travel_m.at(i) = 1000.0 * std::uniform_real_distribution<double>()(engine_);
  }
}

WheelReading WheelSensors::Measure(const WheelMotion& motion) {
  const double period_s = last_ ? static_cast<double>(motion.time_ns - last_->time_ns) * 1e-9 : 1.0;
  for (std::size_t i = 0; i < kWheels; ++i) {
    const double travel_m = last_ ? motion.travel_m.at(i) - last_->travel_m.at(i) : 0.0;
    const double factor = scale_.at(i) * (1.0 + SlipOf(i, motion, travel_m));
    const double noise_m = NoiseOf(travel_m);
    reading_.travel_m.at(i) += factor * travel_m + noise_m;
    reading_.speeds_mps.at(i) = factor * motion.speeds_mps.at(i) + noise_m / period_s;
  }
  reading_.steering_rad = motion.steering_rad;
  reading_.yaw_rate_radps = motion.yaw_rate_radps + options_.yaw_rate_bias_radps +
                            options_.yaw_rate_noise_radps * normal_(engine_);
  last_ = motion;
  return reading_;
}

double WheelSensors::SlipOf(std::size_t wheel, const WheelMotion& motion, double travel_m) {
  // A road changes within some metres. How much more or less it slips there no calibration finds.
  constexpr double kGripLengthM = 10.0;
  constexpr double kGripSigma = 0.5;
  const double kept = std::exp(-std::abs(travel_m) / kGripLengthM);
  double& grip = grip_.at(wheel);
  grip = kept * grip + std::sqrt(1.0 - kept * kept) * normal_(engine_);

  const bool is_right = wheel % 2 == 1;
  const double outward = is_right ? 1.0 : -1.0;  // in a bend to the left
  const double forward = motion.speeds_mps.at(wheel) < 0.0 ? -1.0 : 1.0;
  const double slip = options_.traction_slip_per_mps2 * forward * motion.acceleration_mps2 +
                      options_.turn_slip_per_mps2 * outward * motion.lateral_acceleration_mps2;
  return std::clamp(slip * (1.0 + kGripSigma * grip), -0.5, 0.5);
}

double WheelSensors::NoiseOf(double travel_m) {
  double noise_m = sigma_ * std::sqrt(std::abs(travel_m)) * normal_(engine_);
  const double slips = options_.slips_per_m * std::abs(travel_m);
  if (slips > 0.0 && std::uniform_real_distribution<double>()(engine_) < slips) {
    noise_m += options_.slip_sigma_m * normal_(engine_);
  }
  return noise_m;
}

}  // namespace relocd
