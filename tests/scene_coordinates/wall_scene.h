#pragma once

#include <vector>

#include "camera/pinhole_camera.h"
#include "features/gradient_histograms.h"
#include "features/texture.h"
#include "scene_coordinates/training_set.h"

namespace relocd {

/// A textured wall, z = 8 m + x / 4 in W, and a camera that drives along it and looks at it: the
/// smallest world in which depths and points are known.
class WallScene {
 public:
  static constexpr int kWidth = 240;
  static constexpr int kHeight = 160;

  static CameraIntrinsics Intrinsics() {
    return {.fx = 220.0,
            .fy = 220.0,
            .cx = 119.5,
            .cy = 79.5,
            .width = kWidth,
            .height = kHeight,
            .distortion = {}};
  }

  static GradientHistogramsConfig Features() {
    GradientHistogramsConfig config;
    config.image_width = kWidth;
    config.image_height = kHeight;
    config.working_width = kWidth;
    config.working_height = kHeight;
    config.octaves = 3;
    return config;
  }

  /// The depth along the camera's z at which the ray (x, y, 1) of X_WC meets the wall.
  static double Depth(const Pose3& X_WC, const Eigen::Vector2d& ray) {
    const Eigen::Vector3d normal(-0.25, 0.0, 1.0);
    const Eigen::Vector3d direction_W = X_WC.R() * Eigen::Vector3d(ray.x(), ray.y(), 1.0);
    return (8.0 - normal.dot(X_WC.translation())) / normal.dot(direction_W);
  }

  [[nodiscard]] TrainingImage View(const Pose3& X_WC) const {
    const PinholeCamera camera(Intrinsics());
    TrainingImage view;
    view.X_WC = X_WC;
    view.image = {.width = kWidth, .height = kHeight, .pixels = {}};
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const Eigen::Vector2d ray = *camera.Unproject({u, v});
        const Eigen::Vector3d p_WP =
            X_WC * (Depth(X_WC, ray) * Eigen::Vector3d(ray.x(), ray.y(), 1.0));
        constexpr double kPixelsPerMetre = 27.0;
        const double gray = texture_.At(kPixelsPerMetre * p_WP.x(), kPixelsPerMetre * p_WP.y());
        view.image.pixels.push_back(static_cast<std::uint8_t>(gray));
      }
    }
    return view;
  }

  /// `count` views, 0.4 m apart.
  [[nodiscard]] std::vector<TrainingImage> Drive(int count) const {
    std::vector<TrainingImage> views;
    for (int index = 0; index < count; ++index) {
      views.push_back(
          View(Pose3(Eigen::Quaterniond::Identity(), {0.4 * index, 0.02 * index, 0.0})));
    }
    return views;
  }

 private:
  Texture texture_{11};
};

}  // namespace relocd
