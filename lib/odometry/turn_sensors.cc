#include "odometry/turn_sensors.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

/// What is published takes the errors of increments to be independent, which those of a bias are
/// not: over so long they then add up to the same.
constexpr double kBiasHorizonS = 60.0;

double Square(double value) {
  return value * value;
}

struct Field {
  const char* name;
  double value;
  bool is_right;
  const char* allowed;
};

template <typename Fields>
Result<void> Check(const Fields& fields) {
  for (const Field& field : fields) {
    if (field.is_right && std::isfinite(field.value)) continue;
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{} is {}, must be {}", field.name, field.value, field.allowed)};
  }
  return {};
}

}  // namespace

Result<void> SteeringConfig::Validate() const {
  if (signal.empty() && !fraction_signal.empty()) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("fraction_signal is '{}', must be empty without a signal", fraction_signal)};
  }
  return Check(std::initializer_list<Field>{
      {"unit_rad", unit_rad, unit_rad != 0.0, "finite and not 0"},
      {"ratio", ratio, ratio > 0.0, "positive and finite"},
      {"offset_rad", offset_rad, true, "finite"},
      {"sigma_rad", sigma_rad, sigma_rad > 0.0, "positive and finite"}});
}

Result<void> YawRateConfig::Validate() const {
  return Check(std::initializer_list<Field>{
      {"unit_radps", unit_radps, unit_radps != 0.0, "finite and not 0"},
      {"scale", scale, scale > 0.0, "positive and finite"},
      {"bias_radps", bias_radps, true, "finite"},
      {"bias_sigma_radps", bias_sigma_radps, bias_sigma_radps > 0.0, "positive and finite"},
      {"bias_walk_radps_per_sqrt_s",
       bias_walk_radps_per_sqrt_s,
       bias_walk_radps_per_sqrt_s >= 0.0,
       "at least 0 and finite"},
      {"noise_rad_per_sqrt_s",
       noise_rad_per_sqrt_s,
       noise_rad_per_sqrt_s > 0.0,
       "positive and finite"}});
}

YawRateSensor::YawRateSensor(const YawRateConfig& config, double resolution_radps, Duration max_age)
    : config_(config),
      resolution_radps_(resolution_radps),
      max_age_(max_age),
      bias_radps_(config.bias_radps),
      bias_variance_(Square(config.bias_sigma_radps)) {}

void YawRateSensor::Add(MonotonicTime time, double rate_radps) {
  if (rate_time_ && time <= *rate_time_) return;
  if (rate_time_) {
    const Duration gap = time - *rate_time_;
    has_gap_ = has_gap_ || gap > max_age_;
    angle_rad_ += 0.5 * (rate_radps_ + rate_radps) * ToSeconds(gap);
  }
  rate_time_ = time;
  rate_radps_ = rate_radps;
}

std::optional<TurnMeasurement> YawRateSensor::TurnTo(MonotonicTime time) {
  const auto before = std::exchange(turn_time_, time);
  const double angle_before = turn_angle_rad_;
  last_rate_radps_.reset();
  if (!rate_time_) return std::nullopt;
  // Rates that came after `time` are taken back, those that did not come yet are as the last one.
  turn_angle_rad_ = angle_rad_ + rate_radps_ * ToSeconds(time - *rate_time_);
  const bool is_known = before && *before < time && !std::exchange(has_gap_, false) &&
                        time - *rate_time_ <= max_age_ && had_rate_;
  had_rate_ = time - *rate_time_ <= max_age_;
  if (!before || *before >= time) return std::nullopt;
  last_duration_s_ = ToSeconds(time - *before);
  bias_variance_ += Square(config_.bias_walk_radps_per_sqrt_s) * last_duration_s_;
  if (!is_known) return std::nullopt;
  const double angle_rad = turn_angle_rad_ - angle_before;
  last_rate_radps_ = angle_rad / last_duration_s_;
  const double variance = Square(config_.noise_rad_per_sqrt_s) * last_duration_s_ +
                          bias_variance_ * last_duration_s_ * kBiasHorizonS;
  return TurnMeasurement{.turn_rad = config_.scale * (angle_rad - bias_radps_ * last_duration_s_),
                         .variance_rad2 = Square(config_.scale) * variance};
}

void YawRateSensor::Restart() {
  const double bias_radps = bias_radps_;
  const double bias_variance = bias_variance_;
  *this = YawRateSensor(config_, resolution_radps_, max_age_);
  bias_radps_ = bias_radps;
  bias_variance_ = bias_variance;
}

double YawRateSensor::RateVariance() const {
  return Square(config_.noise_rad_per_sqrt_s) / last_duration_s_ + Square(resolution_radps_) / 12.0;
}

bool YawRateSensor::IsUnlikeBias(double deviations) const {
  return last_rate_radps_ && Square(*last_rate_radps_ - bias_radps_) >
                                 Square(deviations) * (bias_variance_ + RateVariance());
}

void YawRateSensor::DoubtBias() {
  if (last_rate_radps_)
    bias_variance_ = std::max(bias_variance_, Square(*last_rate_radps_ - bias_radps_));
}

void YawRateSensor::LearnBias() {
  if (!last_rate_radps_ || last_duration_s_ <= 0.0) return;
  const double variance = Square(config_.noise_rad_per_sqrt_s) / last_duration_s_;
  const double gain = bias_variance_ / (bias_variance_ + variance);
  bias_radps_ += gain * (*last_rate_radps_ - bias_radps_);
  // Where the noise is less than a step of the signal, waiting longer teaches no more.
  bias_variance_ = std::max((1.0 - gain) * bias_variance_,
                            std::min(bias_variance_, Square(resolution_radps_) / 12.0));
}

}  // namespace relocd
