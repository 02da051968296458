#include "scene_coordinates/plane_sweep.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

namespace relocd {
namespace {

/// The octaves that are compared. Coarser ones do not say where exactly.
constexpr int kOctaves = 2;
constexpr double kStepPx = 2.0;  // along the longest sweep: the descriptors' grid
constexpr int kMinSteps = 12;
constexpr int kMaxSteps = 160;
/// Depths that are this many steps from the best count as elsewhere.
constexpr int kPeakSteps = 4;
constexpr int kMinNeighbours = 2;
/// A neighbour's place this near to the border has a descriptor that is cut.
constexpr float kBorderPx = 8.0F;

using Roots = std::array<std::array<float, GradientMaps::kDescriptorSize>, kOctaves>;

Roots ReferenceRoots(const GradientMaps& maps, const Eigen::Vector2f& pixel) {
  Roots roots;
  for (int octave = 0; octave < kOctaves; ++octave) {
    auto& histogram = roots[static_cast<std::size_t>(octave)];
    maps.Sample(octave, pixel.x(), pixel.y(), histogram);
    const float sum = std::max(std::reduce(histogram.begin(), histogram.end()), 1e-6F);
    for (float& value : histogram) {
      value = std::sqrt(value / sum);
    }
  }
  return roots;
}

double AddAffinities(const GradientMaps& maps,
                     const Roots& roots,
                     const Eigen::Vector2f& place,
                     double sum) {
  for (int octave = 0; octave < kOctaves; ++octave) {
    sum += maps.Affinity(octave, place.x(), place.y(), roots[static_cast<std::size_t>(octave)]);
  }
  return sum;
}

}  // namespace

std::optional<Eigen::Vector2f> PlaneSweep::Project(const Ray& ray, double inverse_depth) const {
  // Scaled by the inverse depth, so that infinity is a place like another.
  const Eigen::Vector3d p_N = ray.direction_N + ray.origin_N * inverse_depth;
  const std::optional<Eigen::Vector2d> pixel = camera_.Project(p_N);
  if (!pixel) return std::nullopt;
  const Eigen::Vector2f working = extractor_.ToWorking(pixel->cast<float>());
  const auto width = static_cast<float>(extractor_.config().working_width);
  const auto height = static_cast<float>(extractor_.config().working_height);
  const bool is_inside = working.x() >= kBorderPx && working.x() < width - kBorderPx &&
                         working.y() >= kBorderPx && working.y() < height - kBorderPx;
  return is_inside ? std::optional(working) : std::nullopt;
}

double PlaneSweep::WidestSweepPx(const std::vector<Ray>& rays) const {
  // The image path of depths that the neighbour is asked for.
  double widest_px = 0.0;
  for (const Ray& ray : rays) {
    const double nearest = std::min(1.0 / config_.min_depth_m,
                                    1.0 / (config_.min_depth_per_baseline * ray.baseline_m));
    const auto far_pixel = Project(ray, 1.0 / config_.max_depth_m);
    const auto near_pixel = Project(ray, nearest);
    if (!far_pixel || !near_pixel) continue;
    const double per_inverse_depth =
        (*near_pixel - *far_pixel).cast<double>().norm() / (nearest - 1.0 / config_.max_depth_m);
    widest_px = std::max(widest_px, per_inverse_depth / config_.min_depth_m);
  }
  return widest_px;
}

PlaneSweep::Sweep PlaneSweep::ScoreDepths(const GradientMaps& reference,
                                          const std::vector<Ray>& rays,
                                          const Eigen::Vector2f& pixel) const {
  const Roots roots = ReferenceRoots(reference, pixel);
  const int steps =
      std::clamp(static_cast<int>(WidestSweepPx(rays) / kStepPx), kMinSteps, kMaxSteps);
  Sweep sweep;
  sweep.first = 1.0 / config_.max_depth_m;
  sweep.step = (1.0 / config_.min_depth_m - sweep.first) / (steps - 1);
  sweep.scores.resize(static_cast<std::size_t>(steps), 0.0);
  for (int index = 0; index < steps; ++index) {
    const double inverse_depth = sweep.first + sweep.step * index;
    double sum = 0.0;
    int count = 0;
    for (const Ray& ray : rays) {
      if (IsTooNear(ray, inverse_depth)) continue;
      const auto place = Project(ray, inverse_depth);
      if (!place) continue;
      sum = AddAffinities(*ray.maps, roots, *place, sum);
      ++count;
    }
    if (count >= kMinNeighbours) {
      sweep.scores[static_cast<std::size_t>(index)] = sum / (count * kOctaves);
    }
  }
  return sweep;
}

std::optional<double> PlaneSweep::FindPeak(const Sweep& sweep) const {
  const std::vector<double>& scores = sweep.scores;
  const auto steps = static_cast<int>(scores.size());
  const auto best_at = std::max_element(scores.begin(), scores.end());
  const auto best = static_cast<int>(best_at - scores.begin());
  double elsewhere = 0.0;
  for (int index = 0; index < steps; ++index) {
    if (std::abs(index - best) > kPeakSteps) {
      elsewhere = std::max(elsewhere, scores[static_cast<std::size_t>(index)]);
    }
  }
  if (*best_at < config_.min_affinity || *best_at - elsewhere < config_.min_peak) {
    return std::nullopt;
  }
  if (best == 0 || best == steps - 1) return std::nullopt;
  const double before = *(best_at - 1);
  const double after = *(best_at + 1);
  const double curvature = before - 2.0 * *best_at + after;
  if (before == 0.0 || after == 0.0 || curvature > -1e-9) return std::nullopt;
  return sweep.first + sweep.step * (best + 0.5 * (before - after) / curvature);
}

bool PlaneSweep::IsPrecise(const std::vector<Ray>& rays, double inverse_depth, double step) const {
  double px_per_inverse_depth = 0.0;
  for (const Ray& ray : rays) {
    if (IsTooNear(ray, inverse_depth)) continue;
    const auto here = Project(ray, inverse_depth);
    const auto there = Project(ray, inverse_depth + step);
    if (!here || !there) continue;
    px_per_inverse_depth =
        std::max(px_per_inverse_depth, (*there - *here).cast<double>().norm() / step);
  }
  const double enlargement =
      static_cast<double>(extractor_.config().working_width) / extractor_.config().image_width;
  const double wanted_px_per_inverse_depth =
      enlargement * camera_.intrinsics().fx * config_.disparity_baseline_m;
  return px_per_inverse_depth * config_.max_error_px >= wanted_px_per_inverse_depth;
}

float PlaneSweep::InverseDepth(const GradientMaps& reference,
                               const std::vector<Ray>& rays,
                               const Eigen::Vector2f& pixel) const {
  const Sweep sweep = ScoreDepths(reference, rays, pixel);
  const auto inverse_depth = FindPeak(sweep);
  if (!inverse_depth || !IsPrecise(rays, *inverse_depth, sweep.step)) return 0.0F;
  return static_cast<float>(*inverse_depth);
}

std::vector<float> PlaneSweep::InverseDepths(
    const SweepView& reference,
    std::span<const SweepView> neighbours,
    std::span<const Eigen::Vector2f> working_pixels) const {
  std::vector<float> inverse_depths(working_pixels.size(), 0.0F);
  std::vector<Ray> rays(neighbours.size());
  for (std::size_t cell = 0; cell < working_pixels.size(); ++cell) {
    const auto ray_C =
        camera_.Unproject(extractor_.FromWorking(working_pixels[cell]).cast<double>());
    if (!ray_C) continue;
    for (std::size_t index = 0; index < neighbours.size(); ++index) {
      const Pose3 X_NC = neighbours[index].X_WC.Inverse() * reference.X_WC;
      rays[index] = {neighbours[index].maps,
                     X_NC.R() * ray_C->homogeneous(),
                     X_NC.translation(),
                     X_NC.translation().norm()};
    }
    inverse_depths[cell] = InverseDepth(*reference.maps, rays, working_pixels[cell]);
  }
  return inverse_depths;
}

}  // namespace relocd
