#include "geometry/trajectory_metrics.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/check.h"
#include "geometry/alignment.h"
#include "geometry/covariance.h"
#include "geometry/planar.h"

namespace relocd {
namespace {

/// The distance travelled along the truth up to each pair.
std::vector<double> TravelledDistances(std::span<const PosePair> pairs) {
  std::vector<double> travelled(pairs.size(), 0.0);
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    const Eigen::Vector3d step =
        pairs[i].X_WB_true.translation() - pairs[i - 1].X_WB_true.translation();
    travelled[i] = travelled[i - 1] + step.norm();
  }
  return travelled;
}

RelativeError Compare(const PosePair& from, const PosePair& to, double travelled_m) {
  const Pose3 true_motion = from.X_WB_true.Inverse() * to.X_WB_true;
  const Pose3 motion = from.X_WB.Inverse() * to.X_WB;
  const Pose3 error = true_motion.Inverse() * motion;
  return {.translation_m = error.translation().norm(),
          .rotation_rad = AngleBetween(true_motion.rotation(), motion.rotation()),
          .travelled_m = travelled_m,
          .duration_s = static_cast<double>(to.time_ns - from.time_ns) * 1e-9};
}

/// `is_far_enough(i, j)` must stay true when j grows.
template <typename IsFarEnough>
std::vector<RelativeError> RelativeErrors(std::span<const PosePair> pairs,
                                          const IsFarEnough& is_far_enough,
                                          const std::vector<double>& travelled) {
  std::vector<RelativeError> errors;
  std::size_t j = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    j = std::max(j, i + 1);
    while (j < pairs.size() && !is_far_enough(i, j))
      ++j;
    if (j >= pairs.size()) break;
    errors.push_back(Compare(pairs[i], pairs[j], travelled[j] - travelled[i]));
  }
  return errors;
}

}  // namespace

ErrorSummary Summarize(std::vector<double> errors) {
  if (errors.empty()) return {};
  std::ranges::sort(errors);
  const std::size_t count = errors.size();
  const auto divisor = static_cast<double>(count);
  const double sum = std::accumulate(errors.begin(), errors.end(), 0.0);
  const double squares = std::inner_product(errors.begin(), errors.end(), errors.begin(), 0.0);
  constexpr double kShare = 0.95;
  const auto rank = static_cast<std::size_t>(std::ceil(kShare * divisor - 1e-9));
  return {.count = count,
          .mean = sum / divisor,
          .rmse = std::sqrt(squares / divisor),
          .median = 0.5 * (errors[(count - 1) / 2] + errors[count / 2]),
          .p95 = errors[std::max<std::size_t>(rank, 1) - 1],
          .max = errors.back()};
}

std::vector<double> PositionErrors(std::span<const PosePair> pairs) {
  std::vector<double> errors;
  errors.reserve(pairs.size());
  for (const PosePair& pair : pairs)
    errors.push_back((pair.X_WB.translation() - pair.X_WB_true.translation()).norm());
  return errors;
}

std::vector<double> RotationErrors(std::span<const PosePair> pairs) {
  std::vector<double> errors;
  errors.reserve(pairs.size());
  for (const PosePair& pair : pairs)
    errors.push_back(AngleBetween(pair.X_WB.rotation(), pair.X_WB_true.rotation()));
  return errors;
}

Result<Pose3> AlignToTruth(std::span<const PosePair> pairs, bool planar) {
  std::vector<Eigen::Vector3d> truths;
  std::vector<Eigen::Vector3d> estimates;
  for (const PosePair& pair : pairs) {
    truths.push_back(pair.X_WB_true.translation());
    estimates.push_back(pair.X_WB.translation());
  }
  if (!planar) return AlignPoints(truths, estimates);
  std::vector<Eigen::Vector2d> planar_truths;
  std::vector<Eigen::Vector2d> planar_estimates;
  for (std::size_t i = 0; i < truths.size(); ++i) {
    planar_truths.emplace_back(truths[i].head<2>());
    planar_estimates.emplace_back(estimates[i].head<2>());
  }
  const auto alignment = AlignPoints(planar_truths, planar_estimates);
  if (!alignment) return alignment.error();
  return LiftFromPlane(*alignment);
}

std::vector<RelativeError> RelativeErrorsOverDistance(std::span<const PosePair> pairs,
                                                      double distance_m) {
  const std::vector<double> travelled = TravelledDistances(pairs);
  return RelativeErrors(
      pairs,
      [&](std::size_t i, std::size_t j) { return travelled[j] - travelled[i] >= distance_m; },
      travelled);
}

std::vector<RelativeError> RelativeErrorsOverTime(std::span<const PosePair> pairs,
                                                  std::int64_t duration_ns) {
  return RelativeErrors(
      pairs,
      [&](std::size_t i, std::size_t j) {
        return pairs[j].time_ns - pairs[i].time_ns >= duration_ns;
      },
      TravelledDistances(pairs));
}

void CoverageCounter::Add(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance) {
  RELOCD_CHECK(IsCovariance(covariance), "a covariance that is none");
  AddPosition(error.head<2>(), covariance.topLeftCorner<2, 2>());
  const double distance = SquaredMahalanobis(error, covariance);
  ++pose_count_;
  if (distance <= kChiSquared95Dof3) ++poses_inside_;
  pose_sum_ += distance;
}

void CoverageCounter::AddPosition(const Eigen::Vector2d& error, const Eigen::Matrix2d& covariance) {
  RELOCD_CHECK(IsCovariance(covariance), "a covariance that is none");
  const double distance = SquaredMahalanobis(error, covariance);
  ++position_count_;
  if (distance <= kChiSquared95Dof2) ++positions_inside_;
  position_sum_ += distance;
}

Coverage CoverageCounter::Total() const {
  const auto share = [](double part, std::size_t whole) {
    return whole == 0 ? 0.0 : part / static_cast<double>(whole);
  };
  return {.position_count = position_count_,
          .pose_count = pose_count_,
          .position_share = share(static_cast<double>(positions_inside_), position_count_),
          .pose_share = share(static_cast<double>(poses_inside_), pose_count_),
          .position_nees = share(position_sum_, position_count_),
          .pose_nees = share(pose_sum_, pose_count_)};
}

}  // namespace relocd
