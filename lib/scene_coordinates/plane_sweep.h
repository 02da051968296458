#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "camera/pinhole_camera.h"
#include "features/gradient_histograms.h"
#include "features/gradient_maps.h"
#include "geometry/pose3.h"

namespace relocd {

/// One image's gradients and where it was taken. Borrows the gradients.
struct SweepView {
  const GradientMaps* maps = nullptr;
  Pose3 X_WC;
};

struct PlaneSweepConfig {
  double min_depth_m = 2.5;
  double max_depth_m = 200.0;
  /// Neighbours are asked only while the point is at least this many baselines away, so that it
  /// looks much the same to them.
  double min_depth_per_baseline = 3.0;
  double min_affinity = 0.86;
  /// How much better the best depth must be than the best one that is elsewhere.
  double min_peak = 0.012;
  /// An inverse depth is kept if a pixel's error in the best neighbour changes it by less than a
  /// pixel of disparity over this baseline divided by max_error_px.
  double disparity_baseline_m = 2.0;
  double max_error_px = 2.5;
};

/// Measures depths of cells between images with known poses: tries inverse depths along the viewing
/// ray and keeps the one at which the neighbours' descriptors agree with the cell's (plane sweep,
/// R. Collins, "A space-sweep approach to true multi-image matching", 1996).
///
/// Lacks a depth where there is no texture, no parallax, or more than one good answer.
class PlaneSweep {
 public:
  /// Borrows the camera and the extractor (for its pixels only), which must outlive it.
  PlaneSweep(const PinholeCamera& camera,
             const GradientHistograms& extractor,
             const PlaneSweepConfig& config)
      : camera_(camera), extractor_(extractor), config_(config) {}

  /// @param working_pixels  cells of the reference, in working pixels.
  /// @return the inverse depth of each in 1/m, 0 where there is none.
  [[nodiscard]] std::vector<float> InverseDepths(
      const SweepView& reference,
      std::span<const SweepView> neighbours,
      std::span<const Eigen::Vector2f> working_pixels) const;

 private:
  /// A neighbour, and the cell's ray as that neighbour sees it: p_N = ray * depth + origin.
  struct Ray {
    const GradientMaps* maps = nullptr;
    Eigen::Vector3d direction_N;
    Eigen::Vector3d origin_N;
    double baseline_m = 0.0;
  };

  /// How well each of some inverse depths agrees with the neighbours: 0 where too few see it.
  struct Sweep {
    double first = 0.0;
    double step = 0.0;
    std::vector<double> scores;
  };

  [[nodiscard]] Sweep ScoreDepths(const GradientMaps& reference,
                                  const std::vector<Ray>& rays,
                                  const Eigen::Vector2f& pixel) const;
  /// The inverse depth of the one peak, if there is one.
  [[nodiscard]] std::optional<double> FindPeak(const Sweep& sweep) const;
  /// Whether the neighbour that sees it best sees it well enough for what the trainer wants.
  [[nodiscard]] bool IsPrecise(const std::vector<Ray>& rays,
                               double inverse_depth,
                               double step) const;
  [[nodiscard]] bool IsTooNear(const Ray& ray, double inverse_depth) const {
    return ray.baseline_m * inverse_depth * config_.min_depth_per_baseline > 1.0;
  }
  [[nodiscard]] float InverseDepth(const GradientMaps& reference,
                                   const std::vector<Ray>& rays,
                                   const Eigen::Vector2f& pixel) const;
  [[nodiscard]] std::optional<Eigen::Vector2f> Project(const Ray& ray, double inverse_depth) const;
  [[nodiscard]] double WidestSweepPx(const std::vector<Ray>& rays) const;

  const PinholeCamera& camera_;
  const GradientHistograms& extractor_;
  PlaneSweepConfig config_;
};

}  // namespace relocd
