#include "smoothing/smoother_config.h"

#include <cmath>
#include <limits>
#include <string_view>

#include <fmt/format.h>

namespace relocd {
namespace {

/// A value and where it must lie. `!(a < b)` catches NaN as well.
struct RangeRule {
  std::string_view name;
  double value;
  double low;
  bool low_is_allowed;
  double high = std::numeric_limits<double>::max();
};

Result<void> CheckRange(const RangeRule& rule) {
  const bool above = rule.low_is_allowed ? rule.value >= rule.low : rule.value > rule.low;
  if (above && rule.value <= rule.high) return {};
  if (rule.high < std::numeric_limits<double>::max()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{} is {}, must be in {}{}, {}]",
                             rule.name,
                             rule.value,
                             rule.low_is_allowed ? '[' : '(',
                             rule.low,
                             rule.high)};
  }
  return Error{ErrorKind::kInvalidInput,
               fmt::format("{} is {}, must be {} {} and finite",
                           rule.name,
                           rule.value,
                           rule.low_is_allowed ? ">=" : ">",
                           rule.low)};
}

template <std::size_t N>
Result<void> CheckRanges(const RangeRule (&rules)[N]) {
  for (const RangeRule& rule : rules) {
    if (auto ok = CheckRange(rule); !ok) return ok;
  }
  return {};
}

}  // namespace

Result<void> OdometryNoiseConfig::Validate() const {
  const RangeRule rules[] = {
      {"forward_sigma_m_per_sqrt_m", forward_sigma_m_per_sqrt_m, 0.0, true},
      {"sideways_sigma_m_per_sqrt_m", sideways_sigma_m_per_sqrt_m, 0.0, true},
      {"position_sigma_m_per_sqrt_s", position_sigma_m_per_sqrt_s, 0.0, false},
      {"heading_sigma_rad_per_sqrt_m", heading_sigma_rad_per_sqrt_m, 0.0, true},
      {"heading_sigma_rad_per_sqrt_rad", heading_sigma_rad_per_sqrt_rad, 0.0, true},
      {"heading_sigma_rad_per_sqrt_s", heading_sigma_rad_per_sqrt_s, 0.0, false},
  };
  return CheckRanges(rules);
}

Result<void> SmootherConfig::Validate() const {
  const RangeRule rules[] = {
      {"window_keyframes", static_cast<double>(window_keyframes), 2.0, true, 5000.0},
      {"keyframe_distance_m", keyframe_distance_m, 0.0, false},
      {"keyframe_angle_rad", keyframe_angle_rad, 0.0, false},
      {"keyframe_interval_s", keyframe_interval_s, 0.0, false},
      {"max_iterations", static_cast<double>(max_iterations), 1.0, true, 100.0},
      {"odometry_covariance_factor", odometry_covariance_factor, 0.0, false},
      {"odometry_drift_sigma_rad_per_m", odometry_drift_sigma_rad_per_m, 0.0, true},
      {"odometry_yaw_rate_sigma_rad_per_s", odometry_yaw_rate_sigma_rad_per_s, 0.0, true},
      {"odometry_scale_sigma", odometry_scale_sigma, 0.0, true},
      {"cauchy_scale_sigmas", cauchy_scale_sigmas, 0.0, false},
      {"gate_squared_mahalanobis", gate_squared_mahalanobis, 0.0, false},
      {"fix_correlation_time_s", fix_correlation_time_s, 0.0, true},
      {"fix_bias_sigmas", fix_bias_sigmas, 0.0, true},
      {"fix_bias_time_s", fix_bias_time_s, 0.0, false},
      {"camera_yaw_sigma_rad", camera_yaw_sigma_rad, 0.0, true, 0.5},
      {"camera_time_sigma_s", camera_time_sigma_s, 0.0, true, 1.0},
      {"max_fixes_per_keyframe", static_cast<double>(max_fixes_per_keyframe), 1.0, true, 1000.0},
      {"max_fix_age_s", max_fix_age_s, 0.0, false},
      {"max_extrapolation_s", max_extrapolation_s, 0.0, true},
      {"default_fix_sigma_m", default_fix_sigma_m, 0.0, false},
      {"default_fix_heading_sigma_rad", default_fix_heading_sigma_rad, 0.0, false},
      {"start_fixes", static_cast<double>(start_fixes), 1.0, true, 1000.0},
      {"start_inlier_share", start_inlier_share, 0.0, false, 1.0},
      {"relocalization_window", static_cast<double>(relocalization_window), 10.0, true, 200.0},
      {"relocalization_spacing_s", relocalization_spacing_s, 0.0, true},
      {"relocalization_radius_sigmas", relocalization_radius_sigmas, 0.0, false},
      {"relocalization_min_radius_m", relocalization_min_radius_m, 0.0, true},
      {"relocalization_inlier_share", relocalization_inlier_share, 0.0, false, 1.0},
      {"ok_fixes", static_cast<double>(ok_fixes), 1.0, true, 1000.0},
      {"ok_sigma_m", ok_sigma_m, 0.0, false},
      {"ok_heading_sigma_rad", ok_heading_sigma_rad, 0.0, false},
      {"dead_reckoning_after_s", dead_reckoning_after_s, 0.0, false},
  };
  if (auto ok = CheckRanges(rules); !ok) return ok;
  if (auto ok = default_odometry_noise.Validate(); !ok) {
    auto error = std::move(ok).error();
    error.message = "default_odometry_noise." + error.message;
    return error;
  }
  return {};
}

}  // namespace relocd
