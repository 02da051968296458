#include "smoothing/systematic_errors.h"

#include <array>
#include <cstddef>
#include <numbers>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace relocd {
namespace {

/// One of the errors: in which unit it is told, and what it is.
struct ErrorName {
  double unit;
  const char* text;
};
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr std::array<ErrorName, 5> kErrorNames{{{kDegree, "deg farther to the left than believed"},
                                                {1.0, "s before the times that it gives"},
                                                {1e-2, "% of the way"},
                                                {1e-3, "mrad of the turn on each metre"},
                                                {1e-3, "mrad of the turn in each second"}}};

/// `count` errors from `first` on.
std::string DescribePart(const SystematicErrors& errors,
                         const char* whose,
                         Eigen::Index first,
                         Eigen::Index count) {
  const SystematicVector sigmas = errors.Sigmas();
  std::vector<std::string> parts;
  for (Eigen::Index i = first; i < first + count; ++i) {
    if (errors.prior_sigmas[i] <= 0.0) continue;
    const ErrorName& name = kErrorNames.at(static_cast<std::size_t>(i));
    parts.push_back(fmt::format(
        "{:.3f} +- {:.3f} {}", errors.estimate[i] / name.unit, sigmas[i] / name.unit, name.text));
  }
  return parts.empty() ? "" : fmt::format("{} {}\n", whose, fmt::join(parts, " and "));
}

}  // namespace

std::string Describe(const SystematicErrors& errors) {
  return DescribePart(errors, "odometry: misses", 2, 3) +
         DescribePart(errors, "camera: looks", 0, 2);
}

Pose2 CorrectMotion(const Pose2& X_AB,
                    const MotionExtent& motion,
                    const MotionCorrection& correction) {
  const double stretch = motion.way_m > 0.0 ? correction.way_m / motion.way_m : 0.0;
  const Pose2 half(0.0, 0.0, 0.5 * correction.turn_rad);
  const Eigen::Vector2d translation = (1.0 + stretch) * X_AB.translation();
  return half * Pose2(translation.x(), translation.y(), X_AB.yaw()) * half;
}

ByOdometry MotionByOdometryErrors(const Pose2& X_AB, const MotionExtent& motion) {
  const Eigen::Vector3d by_turn(-0.5 * X_AB.y(), 0.5 * X_AB.x(), 1.0);
  ByOdometry by_errors;
  by_errors << X_AB.x(), 0.0, 0.0, X_AB.y(), 0.0, 0.0, 0.0, 0.0, 0.0;
  by_errors.col(1) = motion.way_m * by_turn;
  by_errors.col(2) = motion.driven_s * by_turn;
  return by_errors;
}

}  // namespace relocd
