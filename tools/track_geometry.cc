#include "track_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace relocd {
namespace {

/// A view, seen from the first one: p_k ~ direction + inverse_depth * origin.
struct RelativeView {
  Eigen::Vector3d direction;
  Eigen::Vector3d origin;
  double x = 0.0;
  double y = 0.0;
};

/// Of one coordinate of one view: the numerator of its error is constant + inverse_depth * slope.
struct Equation {
  double constant = 0.0;
  double slope = 0.0;
};

std::array<Equation, 2> Equations(const RelativeView& view) {
  return {Equation{view.direction.x() - view.x * view.direction.z(),
                   view.origin.x() - view.x * view.origin.z()},
          Equation{view.direction.y() - view.y * view.direction.z(),
                   view.origin.y() - view.y * view.origin.z()}};
}

/// Least squares, weighted as the reprojection errors at the inverse depth of before are.
double SolveInverseDepth(std::span<const RelativeView> views, double before) {
  double slopes = 0.0;
  double products = 0.0;
  for (const RelativeView& view : views) {
    const double z = view.direction.z() + before * view.origin.z();
    const double weight = 1.0 / std::max(1e-4, z * z);
    for (const Equation& equation : Equations(view)) {
      slopes += weight * equation.slope * equation.slope;
      products += weight * equation.slope * equation.constant;
    }
  }
  constexpr double kNoParallax = 1e-16;
  return slopes < kNoParallax ? 0.0 : std::max(0.0, -products / slopes);
}

constexpr std::size_t kMaxViews = 8;

}  // namespace

SegmentFit FitSegment(TrackSegment segment,
                      std::span<const FramePose> poses,
                      const SegmentScale& scale) {
  std::array<RelativeView, kMaxViews> storage;
  const std::size_t count = std::min(kMaxViews, segment.size() - 1);
  const double per_factor = 1.0 / scale.focal_factor;
  const Eigen::Vector2d first = per_factor * segment.front().ray.cast<double>();
  const FramePose& reference = poses[segment.front().frame];
  const Eigen::Vector3d direction_W = reference.R_WC * first.homogeneous();
  for (std::size_t k = 0; k < count; ++k) {
    const CornerView& view = segment[k + 1];
    const FramePose& pose = poses[view.frame];
    storage[k] = {pose.R_WC.transpose() * direction_W,
                  pose.R_WC.transpose() * (reference.p_WC - pose.p_WC),
                  per_factor * view.ray.x(),
                  per_factor * view.ray.y()};
  }
  const std::span<const RelativeView> views(storage.data(), count);
  double inverse_depth = 0.0;
  for (int step = 0; step < 3; ++step)
    inverse_depth = SolveInverseDepth(views, inverse_depth);

  const double focal_px = scale.focal_px * scale.focal_factor;
  SegmentFit fit{.inverse_depth = inverse_depth};
  double squares = 0.0;
  for (const RelativeView& view : views) {
    constexpr double kBehind = 1e-2;  // of the first view's depth
    const double z = view.direction.z() + inverse_depth * view.origin.z();
    if (z < kBehind) {
      fit.error_px = 1e3 * scale.tolerance_px;
      return fit;
    }
    double parallax2 = 0.0;
    for (const Equation& equation : Equations(view)) {
      const double moved = inverse_depth * equation.slope;
      squares += (equation.constant + moved) * (equation.constant + moved) / (z * z);
      parallax2 += moved * moved;
    }
    fit.parallax_px = std::max(fit.parallax_px, focal_px * std::sqrt(parallax2) / z);
  }
  fit.error_px = focal_px * std::sqrt(squares / static_cast<double>(count));
  return fit;
}

double MotionPx(TrackSegment segment, double focal_px) {
  return focal_px * (segment.back().ray - segment.front().ray).cast<double>().norm();
}

PoseSupport MeasureSupport(std::span<const TrackSegment> segments,
                           std::span<const FramePose> poses,
                           const SegmentScale& scale) {
  PoseSupport support{.segments = segments.size()};
  if (segments.empty()) return support;
  std::size_t fitting = 0;
  for (const TrackSegment& segment : segments) {
    const double error = FitSegment(segment, poses, scale).error_px / scale.tolerance_px;
    if (error < 1.0) ++fitting;
    support.cost += error * error / (1.0 + error * error);
  }
  const auto count = static_cast<double>(segments.size());
  support.share = static_cast<double>(fitting) / count;
  support.cost /= count;
  return support;
}

std::vector<TrackSegment> InformativeSegments(const std::vector<CornerTrack>& tracks,
                                              std::size_t views,
                                              const SegmentScale& scale,
                                              std::size_t most) {
  constexpr double kLeastMotion = 4.0;  // tolerances
  std::vector<TrackSegment> all;
  for (const CornerTrack& track : tracks) {
    for (std::size_t begin = 0; begin + views <= track.size(); ++begin) {
      const TrackSegment segment = TrackSegment(track).subspan(begin, views);
      if (MotionPx(segment, scale.focal_px) >= kLeastMotion * scale.tolerance_px) {
        all.push_back(segment);
      }
    }
  }
  if (all.size() <= most) return all;
  std::vector<TrackSegment> chosen;
  for (std::size_t i = 0; i < most; ++i)
    chosen.push_back(all[i * all.size() / most]);
  return chosen;
}

}  // namespace relocd
