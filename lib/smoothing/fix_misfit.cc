#include "smoothing/fix_misfit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace relocd {
namespace {

constexpr double kReach = 10.0;  // s; errors were seen to last 3 to 8 s
constexpr double kUsualMisfit = 16.0;
/// Fixes that are believed less than this cannot hold an estimate that is wrong, and so pull even
/// less: the odometry would be followed away from all of them.
constexpr double kMostMisfit = 30.0;
constexpr double kUsualWeight = 10.0;  // in fixes

Eigen::Vector2d WhitenedError(const KeyframeWindow& window, const AttachedFix& fix) {
  const Eigen::Vector3d& x_WK =
      window.keyframes[static_cast<std::size_t>(fix.keyframe_id - window.keyframes.front().id)]
          .x_WK;
  return fix.covariance_root.topLeftCorner<2, 2>().triangularView<Eigen::Lower>().solve(
      fix.residual.Linearize(x_WK).error.head<2>());
}

}  // namespace

/// From the better third of the fixes: more than half may be wrong.
double FixMisfit::Scatter() {
  constexpr double kQuantile = 0.3;
  // Of the squared length of a standard normal vector in the plane.
  const double expected = -2.0 * std::log(1.0 - kQuantile);
  constexpr double kWeightOfOne = 10.0;  // in fixes: few of them scatter by chance
  if (squared_.empty()) return 1.0;
  const auto count = static_cast<double>(squared_.size());
  const auto chosen = squared_.begin() + static_cast<std::ptrdiff_t>(kQuantile * count);
  std::nth_element(squared_.begin(), chosen, squared_.end());
  return std::min(kMostMisfit,
                  (count * *chosen / expected + kWeightOfOne) / (count + kWeightOfOne));
}

FixErrors FixMisfit::Measure(const KeyframeWindow& window, const FixWeighting& weighting) {
  squared_.clear();
  for (const AttachedFix& fix : window.fixes) {
    if (!fix.is_gated) squared_.push_back(WhitenedError(window, fix).squaredNorm());
  }
  const double scatter = Scatter();
  // Fixes that scatter less than they say are not believed more for it: their errors have tails.
  const double scatter_factor = std::max(1.0, scatter);

  // The sum over pairs of a weight that falls exponentially, in one pass.
  Eigen::Vector2d recent = Eigen::Vector2d::Zero();
  double squared = 0.0;
  double shares = 0.0;
  MonotonicTime last{};
  for (const AttachedFix& fix : window.fixes) {
    if (fix.share <= 0.0) continue;
    const Eigen::Vector2d whitened = WhitenedError(window, fix) / std::sqrt(scatter_factor);
    const Eigen::Vector2d pull =
        fix.share * weighting.UnitKernelWeight(whitened.squaredNorm()) * whitened;
    recent *= std::exp(-ToSeconds(fix.fix.time - last) / kReach);
    squared += pull.squaredNorm() + 2.0 * pull.dot(recent);
    recent += pull;
    shares += fix.share;
    last = fix.fix.time;
  }
  const double misfit = (squared / weighting.ExpectedSquaredPull() + kUsualWeight * kUsualMisfit) /
                        (shares + kUsualWeight);
  return {.scatter = scatter,
          .misfit = std::min(kMostMisfit, scatter_factor * std::max(1.0, misfit))};
}

}  // namespace relocd
