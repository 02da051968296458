#include "relocalization/pose_ransac.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>

#include "core/counter_random.h"
#include "relocalization/p3p.h"
#include "relocalization/soft_inlier_score.h"

namespace relocd {
namespace {

constexpr std::size_t kSampleSize = 4;
using Sample = std::array<std::size_t, kSampleSize>;

/// Four of the indices; nothing if two of them are the same.
std::optional<Sample> DrawSample(const CounterRandom& random,
                                 std::uint64_t draw,
                                 std::span<const std::uint32_t> indices) {
  const auto bound = static_cast<std::uint32_t>(indices.size());
  const std::uint64_t first = random.Bits(2 * draw);
  const std::uint64_t second = random.Bits(2 * draw + 1);
  const Sample sample{
      indices[CounterRandom::Below(bound, static_cast<std::uint32_t>(first))],
      indices[CounterRandom::Below(bound, static_cast<std::uint32_t>(first >> 32))],
      indices[CounterRandom::Below(bound, static_cast<std::uint32_t>(second))],
      indices[CounterRandom::Below(bound, static_cast<std::uint32_t>(second >> 32))]};
  for (std::size_t i = 1; i < kSampleSize; ++i) {
    if (std::find(sample.begin(), sample.begin() + i, sample[i]) != sample.begin() + i) {
      return std::nullopt;
    }
  }
  return sample;
}

P3pSolutions SolveSample(const PackedCorrespondences& correspondences, const Sample& sample) {
  Eigen::Matrix3d rays_C;
  Eigen::Matrix3d p_MPs;
  for (std::size_t i = 0; i < 3; ++i) {
    rays_C.col(static_cast<Eigen::Index>(i)) = correspondences.Ray_C(sample[i]);
    p_MPs.col(static_cast<Eigen::Index>(i)) = correspondences.p_MP(sample[i]);
  }
  return SolveP3p(rays_C, p_MPs);
}

/// The solution that the fourth point fits best, if it fits any.
std::optional<CameraFromWorld> ConfirmedByFourth(const PackedCorrespondences& correspondences,
                                                 std::size_t fourth,
                                                 const P3pSolutions& solutions,
                                                 double threshold_px) {
  std::optional<CameraFromWorld> confirmed;
  double least = threshold_px * threshold_px;
  for (const CameraFromWorld& X_CM : solutions) {
    const Eigen::Vector3d p_CP = X_CM * correspondences.p_MP(fourth);
    if (p_CP.z() < kMinDepth) continue;
    const Eigen::Vector2d projected =
        correspondences.focal().cwiseProduct(p_CP.head<2>()) / p_CP.z();
    const double error = (projected - correspondences.pixel(fourth)).squaredNorm();
    if (!(error < least)) continue;
    least = error;
    confirmed = X_CM;
  }
  return confirmed;
}

void Draw(const PackedCorrespondences& correspondences,
          const PoseRansacOptions& options,
          std::uint64_t seed,
          PoseRansacResult& result) {
  const CounterRandom random(seed);
  while (result.hypotheses < options.hypotheses && result.tries < options.max_tries) {
    const auto draw = static_cast<std::uint64_t>(result.tries++);
    const std::optional<Sample> sample = DrawSample(random, draw, correspondences.likely());
    if (!sample) continue;
    const P3pSolutions solutions = SolveSample(correspondences, *sample);
    if (solutions.degenerate) ++result.degenerate_tries;
    const std::optional<CameraFromWorld> X_CM =
        ConfirmedByFourth(correspondences, (*sample)[3], solutions, options.threshold_px);
    if (!X_CM) continue;
    result.best.push_back({.X_CM = *X_CM, .order = static_cast<std::size_t>(result.hypotheses++)});
  }
}

}  // namespace

bool IsBetter(const PoseHypothesis& a, const PoseHypothesis& b) {
  return a.score > b.score || (a.score == b.score && a.order < b.order);
}

PoseRansacResult FindPoses(const PackedCorrespondences& correspondences,
                           const PoseRansacOptions& options,
                           const std::vector<CameraFromWorld>& more,
                           std::uint64_t seed) {
  PoseRansacResult result;
  result.best.reserve(static_cast<std::size_t>(options.hypotheses) + more.size());
  if (correspondences.likely().size() >= kSampleSize) Draw(correspondences, options, seed, result);
  for (const CameraFromWorld& X_CM : more) {
    result.best.push_back({.X_CM = X_CM, .order = static_cast<std::size_t>(result.hypotheses++)});
  }

  for (PoseHypothesis& hypothesis : result.best) {
    hypothesis.score = SoftInlierScore(correspondences,
                                       static_cast<std::size_t>(options.scored_points),
                                       hypothesis.X_CM,
                                       options.threshold_px);
  }
  std::ranges::sort(result.best, IsBetter);
  if (result.best.size() > static_cast<std::size_t>(options.kept)) {
    result.best.resize(static_cast<std::size_t>(options.kept));
  }
  for (PoseHypothesis& hypothesis : result.best) {
    hypothesis.score = SoftInlierScore(
        correspondences, correspondences.size(), hypothesis.X_CM, options.threshold_px);
  }
  std::ranges::sort(result.best, IsBetter);
  return result;
}

}  // namespace relocd
