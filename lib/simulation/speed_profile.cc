#include "simulation/speed_profile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "core/check.h"

namespace relocd {
namespace {

constexpr double kStepM = 0.1;  // finer than anything that limits the speed

double Square(double value) {
  return value * value;
}

/// The limit at places along a leg. The average over time mixes in what is up to `reach_m` away, so
/// the lowest limit within that counts.
std::vector<double> LowestLimits(const SpeedProfile::Leg& leg,
                                 std::size_t steps,
                                 const std::function<double(double)>& speed_limit_mps,
                                 double highest_mps) {
  std::vector<double> limits;
  for (std::size_t i = 0; i <= steps; ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(steps);
    const double limit_mps = speed_limit_mps(leg.from_m + part * (leg.to_m - leg.from_m));
    limits.push_back(std::min(limit_mps, highest_mps));
  }
  const double fastest_mps = *std::max_element(limits.begin(), limits.end());
  const double reach_m = fastest_mps * SpeedProfile::kSmoothingS;
  const double step_m = std::abs(leg.to_m - leg.from_m) / static_cast<double>(steps);
  const auto reach = static_cast<std::size_t>(std::ceil(reach_m / step_m));
  std::vector<double> lowest;
  for (std::size_t i = 0; i <= steps; ++i) {
    const auto begin = limits.begin() + static_cast<std::ptrdiff_t>(i - std::min(i, reach));
    const auto end = limits.begin() + static_cast<std::ptrdiff_t>(std::min(i + reach, steps) + 1);
    lowest.push_back(*std::min_element(begin, end));
  }
  return lowest;
}

/// Lowers the speeds until they begin and end at 0 and do not change faster than they may.
void LimitAcceleration(const SpeedProfile::Limits& limits,
                       double step_m,
                       std::vector<double>& speeds_mps) {
  speeds_mps.front() = 0.0;
  speeds_mps.back() = 0.0;
  for (std::size_t i = 1; i < speeds_mps.size(); ++i) {
    const double reachable_mps =
        std::sqrt(Square(speeds_mps[i - 1]) + 2.0 * limits.acceleration_mps2 * step_m);
    speeds_mps[i] = std::min(speeds_mps[i], reachable_mps);
  }
  for (std::size_t i = speeds_mps.size() - 1; i > 0; --i) {
    const double allowed_mps =
        std::sqrt(Square(speeds_mps[i]) + 2.0 * limits.braking_mps2 * step_m);
    speeds_mps[i - 1] = std::min(speeds_mps[i - 1], allowed_mps);
  }
}

}  // namespace

SpeedProfile::SpeedProfile(double pause_s,
                           const std::vector<Leg>& legs,
                           const std::function<double(double distance_m)>& speed_limit_mps,
                           const Limits& limits) {
  RELOCD_CHECK(!legs.empty(), "a drive has a leg");
  knots_.push_back({.time_s = 0.0, .distance_m = legs.front().from_m});
  Stand(pause_s);
  for (const Leg& leg : legs) {
    const double length_m = std::abs(leg.to_m - leg.from_m);
    const auto steps = static_cast<std::size_t>(std::max(2.0, std::ceil(length_m / kStepM)));
    const double highest_mps =
        leg.to_m < leg.from_m ? limits.reverse_speed_mps : std::numeric_limits<double>::infinity();
    std::vector<double> speeds_mps = LowestLimits(leg, steps, speed_limit_mps, highest_mps);
    LimitAcceleration(limits, length_m / static_cast<double>(steps), speeds_mps);
    Drive(leg, speeds_mps);
    Stand(leg.pause_s);
  }
}

void SpeedProfile::Drive(const Leg& leg, const std::vector<double>& speeds_mps) {
  const double step_m = (leg.to_m - leg.from_m) / static_cast<double>(speeds_mps.size() - 1);
  const double sign = step_m < 0.0 ? -1.0 : 1.0;
  for (std::size_t i = 1; i < speeds_mps.size(); ++i) {
    const Knot& from = knots_.back();
    const double speed_mps = sign * speeds_mps[i];
    const double step_s = 2.0 * step_m / (from.speed_mps + speed_mps);
    const double acceleration_mps2 = (speed_mps - from.speed_mps) / step_s;
    const double integral_ms =
        step_s *
        (from.distance_m + step_s * (from.speed_mps / 2.0 + step_s * acceleration_mps2 / 6.0));
    knots_.push_back({.time_s = from.time_s + step_s,
                      .distance_m = leg.from_m + step_m * static_cast<double>(i),
                      .speed_mps = speed_mps,
                      .integral_ms = from.integral_ms + integral_ms});
  }
}

void SpeedProfile::Stand(double duration_s) {
  Knot knot = knots_.back();
  knot.time_s += duration_s;
  knot.integral_ms += knot.distance_m * duration_s;
  knots_.push_back(knot);
}

SpeedProfile::Knot SpeedProfile::Sharp(double time_s) const {
  const auto after =
      std::upper_bound(knots_.begin(), knots_.end(), time_s, [](double time, const Knot& knot) {
        return time < knot.time_s;
      });
  Knot at = after == knots_.begin() ? knots_.front() : *std::prev(after);
  const double since_s = time_s - at.time_s;
  double acceleration_mps2 = 0.0;
  if (after != knots_.begin() && after != knots_.end())
    acceleration_mps2 = (after->speed_mps - at.speed_mps) / (after->time_s - at.time_s);
  at.time_s = time_s;
  at.integral_ms += since_s * (at.distance_m +
                               since_s * (at.speed_mps / 2.0 + since_s * acceleration_mps2 / 6.0));
  at.distance_m += since_s * (at.speed_mps + since_s * acceleration_mps2 / 2.0);
  at.speed_mps += since_s * acceleration_mps2;
  return at;
}

SpeedProfile::State SpeedProfile::At(double time_s) const {
  const Knot before = Sharp(time_s - 0.5 * kSmoothingS);
  const Knot after = Sharp(time_s + 0.5 * kSmoothingS);
  return {.distance_m = (after.integral_ms - before.integral_ms) / kSmoothingS,
          .speed_mps = (after.distance_m - before.distance_m) / kSmoothingS,
          .acceleration_mps2 = (after.speed_mps - before.speed_mps) / kSmoothingS};
}

}  // namespace relocd
