#include "simulation/fix_simulator.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <fmt/format.h>

namespace relocd {
namespace {

/// Draws the errors of one fix after the other.
class FixErrors {
 public:
  explicit FixErrors(const FixSimulationOptions& options)
      : options_(options), engine_(options.seed), bias_m_(Draw(options.bias_sigma_m)) {}

  SimulatedFix Measure(std::int64_t time_ns, const Pose2& X_WB, double since_last_s) {
    // An Ornstein-Uhlenbeck process: its variance stays what it is.
    const double kept = std::exp(-since_last_s / options_.bias_correlation_s);
    bias_m_ = kept * bias_m_ + Draw(options_.bias_sigma_m * std::sqrt(1.0 - kept * kept));
    Eigen::Vector2d error_m = bias_m_ + Draw(options_.sigma_m);
    double yaw =
        X_WB.yaw() + options_.mounting_yaw_rad + options_.heading_sigma_rad * normal_(engine_);
    const bool is_outlier = uniform_(engine_) < options_.outlier_share;
    if (is_outlier) {
      const double direction = 2.0 * std::numbers::pi * uniform_(engine_);
      const double length_m = options_.outlier_reach_m * uniform_(engine_);
      error_m += length_m * Eigen::Vector2d(std::cos(direction), std::sin(direction));
      yaw += 2.0 * std::numbers::pi * uniform_(engine_);
    }
    const Eigen::Vector2d p_WB = X_WB.translation() + error_m;
    return {.time_ns = time_ns, .X_WB = Pose2(p_WB.x(), p_WB.y(), yaw), .is_outlier = is_outlier};
  }

 private:
  Eigen::Vector2d Draw(double sigma) {
    const double x = normal_(engine_);
    return sigma * Eigen::Vector2d(x, normal_(engine_));
  }

  FixSimulationOptions options_;
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
  Eigen::Vector2d bias_m_;
};

}  // namespace

Result<void> FixSimulationOptions::Validate() const {
  struct Field {
    const char* name;
    double value;
    double low;
    double high;
  };
  for (const Field& field : {Field{"rate_hz", rate_hz, 0.01, 1000.0},
                             Field{"sigma_m", sigma_m, 1e-3, 1e3},
                             Field{"heading_sigma_rad", heading_sigma_rad, 0.0, 3.0},
                             Field{"outlier_share", outlier_share, 0.0, 1.0},
                             Field{"outlier_reach_m", outlier_reach_m, 0.0, 1e6},
                             Field{"bias_sigma_m", bias_sigma_m, 0.0, 1e3},
                             Field{"bias_correlation_s", bias_correlation_s, 1e-3, 1e6},
                             Field{"mounting_yaw_rad", mounting_yaw_rad, -3.0, 3.0},
                             Field{"time_offset_s", time_offset_s, -10.0, 10.0}}) {
    if (field.value >= field.low && field.value <= field.high) continue;
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format(
            "{} is {}, must be in [{}, {}]", field.name, field.value, field.low, field.high)};
  }
  return {};
}

Result<std::vector<SimulatedFix>> SimulateFixes(const Trajectory2& X_WBs,
                                                const FixSimulationOptions& options) {
  if (auto ok = options.Validate(); !ok) return std::move(ok).error();
  const double period_ns = 1e9 / options.rate_hz;
  FixErrors errors(options);
  std::vector<SimulatedFix> fixes;
  double due_ns = -std::numeric_limits<double>::infinity();
  for (const TimedPose2& pose : X_WBs) {
    // At the trajectory's own times: no error of an interpolation is added.
    const auto time_ns = static_cast<double>(pose.time_ns);
    if (time_ns < due_ns) continue;
    const double since_last_s =
        fixes.empty() ? 0.0 : (time_ns - static_cast<double>(fixes.back().time_ns)) * 1e-9;
    due_ns = (fixes.empty() ? time_ns : due_ns) + period_ns;
    fixes.push_back(errors.Measure(pose.time_ns, pose.X_WB, since_last_s));
  }
  const auto late_ns = std::llround(1e9 * options.time_offset_s);
  for (SimulatedFix& fix : fixes)
    fix.time_ns += late_ns;
  return fixes;
}

}  // namespace relocd
