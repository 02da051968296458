#include "calibration/umbmark.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

namespace relocd {
namespace {

/// Centre of gravity, and the variance of each coordinate about it.
struct Cluster {
  int size = 0;
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d variance_m2 = Eigen::Vector2d::Zero();
};

Cluster ClusterOf(const std::vector<SquareRun>& runs, bool clockwise) {
  Cluster cluster;
  for (const SquareRun& run : runs) {
    if (run.clockwise != clockwise) continue;
    ++cluster.size;
    cluster.centre_m += run.error_m;
  }
  if (cluster.size == 0) return cluster;
  cluster.centre_m /= cluster.size;
  for (const SquareRun& run : runs) {
    if (run.clockwise == clockwise)
      cluster.variance_m2 += (run.error_m - cluster.centre_m).cwiseAbs2();
  }
  cluster.variance_m2 /= std::max(cluster.size - 1, 1);
  return cluster;
}

}  // namespace

Result<Umbmark> EvaluateUmbmark(const std::vector<SquareRun>& runs, double side_m, double track_m) {
  if (!(side_m > 0.0) || !(track_m > 0.0)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("side is {} m and track {} m, must be positive", side_m, track_m)};
  }
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (runs[i].error_m.norm() < side_m) continue;
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("run {} ends {} m from where odometry has it, must be below the "
                             "side of {} m",
                             i + 1,
                             runs[i].error_m.norm(),
                             side_m)};
  }
  const Cluster cw = ClusterOf(runs, true);
  const Cluster ccw = ClusterOf(runs, false);
  if (cw.size == 0 || ccw.size == 0) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{} runs clockwise and {} counter-clockwise, must be at least one of "
                             "each, better five",
                             cw.size,
                             ccw.size)};
  }
  Umbmark result{.centre_clockwise_m = cw.centre_m, .centre_counter_clockwise_m = ccw.centre_m};
  result.largest_error_m = std::max(cw.centre_m.norm(), ccw.centre_m.norm());
  // Their equations (10), (15), both from x, which is along the first side.
  result.alpha_rad = (cw.centre_m.x() + ccw.centre_m.x()) / (-4.0 * side_m);
  result.beta_rad = (cw.centre_m.x() - ccw.centre_m.x()) / (-4.0 * side_m);
  const double right_angle = std::numbers::pi / 2.0;
  result.track_factor = right_angle / (right_angle - result.alpha_rad);
  // Radius of the arc that a side is bent to; straight sides have none.
  double ratio = 1.0;
  if (std::abs(result.beta_rad) > 1e-12) {
    const double radius_m = 0.5 * side_m / std::sin(0.5 * result.beta_rad);
    ratio = (radius_m + 0.5 * track_m) / (radius_m - 0.5 * track_m);
  }
  result.left_scale = 2.0 / (ratio + 1.0);
  result.right_scale = 2.0 / (1.0 / ratio + 1.0);
  const Eigen::Vector2d pooled = 0.5 * (cw.variance_m2 + ccw.variance_m2);
  result.spread_m = pooled.cwiseSqrt();
  const double mean_sigma_m =
      std::sqrt(cw.variance_m2.x() / cw.size + ccw.variance_m2.x() / ccw.size);
  const double angle_sigma_rad = mean_sigma_m / (4.0 * side_m);
  result.track_factor_sigma = angle_sigma_rad / right_angle;
  result.ratio_sigma = angle_sigma_rad * track_m / side_m;
  return result;
}

}  // namespace relocd
