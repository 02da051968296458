#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "camera/pinhole_camera.h"
#include "geometry/pose3.h"
#include "rendering/lighting.h"
#include "rendering/linear_image.h"
#include "rendering/ray_tracer.h"

namespace relocd {

struct ImageRendererOptions {
  int samples_per_pixel = 4;  ///< In [1, 64].
  int threads = 1;            ///< In [1, 256].
  double wetness = 0.0;       ///< Of surfaces that can be wet, in [0, 1].
};

/// Where the camera is while an image is exposed: on the way between two poses. A row's exposure
/// covers `exposure_part` of the way, and begins the later the lower the row is.
struct CameraSweep {
  Pose3 X_WC_begin;            ///< When the first row's exposure begins.
  Pose3 X_WC_end;              ///< When the last row's exposure ends.
  double exposure_part = 1.0;  ///< In [0, 1]. 1: all rows are exposed at once.

  static CameraSweep AtRest(const Pose3& X_WC) { return {X_WC, X_WC, 1.0}; }
};

/// Renders what a pinhole camera sees: direct sun with shadows, light of the sky with nearby
/// occlusion, lamps, mirroring in wet and smooth surfaces, haze. Samples are spread over the pixel
/// and over the time of the exposure.
///
/// The image depends on the seed, and not on the number of threads. Thread-bound; uses threads of
/// its own inside Render. Borrows tracer and lighting, which must outlive it.
class ImageRenderer {
 public:
  ImageRenderer(const PinholeCamera& camera,
                const RayTracer& tracer,
                const Lighting& lighting,
                const ImageRendererOptions& options);

  [[nodiscard]] LinearImage Render(const CameraSweep& sweep, std::uint64_t seed) const;

  /// Through the middle of each pixel.
  [[nodiscard]] DepthImage RenderDepth(const Pose3& X_WC) const;

 private:
  class TileRenderer;

  /// Of the viewing ray (x, y, 1) through a corner of a pixel; corner (0, 0) is at pixel
  /// (-0.5, -0.5).
  [[nodiscard]] const Eigen::Vector2f& CornerRay(int column, int row) const {
    return corner_rays_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_ + 1) +
                        static_cast<std::size_t>(column)];
  }

  int width_;
  int height_;
  int grid_side_;       ///< Samples of a pixel are spread over a grid of so many columns and rows.
  float pixel_spread_;  ///< What a pixel becomes wider by along its ray, in m per m.
  float cell_size_;     ///< Of the grid, as part of a pixel.
  float spread_;        ///< What a sample becomes wider by.
  Eigen::Vector3f sun_tangent_ = Eigen::Vector3f::Zero();  ///< Across the direction to the sun.
  Eigen::Vector3f sun_bitangent_ = Eigen::Vector3f::Zero();
  const RayTracer& tracer_;
  const Lighting& lighting_;
  ImageRendererOptions options_;
  std::vector<Eigen::Vector2f> corner_rays_;  ///< Not finite where no ray leads.
};

}  // namespace relocd
