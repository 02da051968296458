#pragma once

#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "camera/pinhole_camera.h"
#include "geometry/pose3.h"
#include "relocalization/correspondence.h"

namespace relocd {

/// Draws poses and points of space, the same ones in every run.
class SceneRandom {
 public:
  explicit SceneRandom(unsigned seed) : engine_(seed) {}

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double Normal(double sigma) { return std::normal_distribution<double>(0.0, sigma)(engine_); }
  Eigen::Vector3d Point(double size) {
    return {Uniform(-size, size), Uniform(-size, size), Uniform(-size, size)};
  }
  /// Any rotation, a position within 10 m of the origin along each axis.
  Pose3 Pose() {
    const Eigen::Quaterniond rotation(Normal(1.0), Normal(1.0), Normal(1.0), Normal(1.0));
    return {rotation, Point(10.0)};
  }

 private:
  std::mt19937 engine_;
};

/// What a scene is like.
struct SceneOptions {
  std::size_t correspondences = 1200;
  double outlier_share = 0.0;
  double pixel_sigma_px = 1.0;
  Eigen::Vector3d p_WScene = Eigen::Vector3d::Zero();  ///< Where about the scene is in the world.
};

/// A camera before a scene 4 to 40 m away, of which everything is known.
struct Scene {
  CameraIntrinsics intrinsics;
  Pose3 X_WC;
  std::vector<Correspondence> correspondences;
  std::vector<bool> is_inlier;

  [[nodiscard]] PinholeCamera camera() const { return PinholeCamera(intrinsics); }
};

inline Scene MakeScene(const SceneOptions& options, unsigned seed) {
  SceneRandom random(seed);
  Scene scene;
  scene.intrinsics = {
      .fx = 500.0, .fy = 505.0, .cx = 318.0, .cy = 243.0, .width = 640, .height = 480};
  scene.intrinsics.distortion = {-0.1, 0.01, 0.0005, -0.0003, 0.0};
  const Pose3 pose = random.Pose();
  scene.X_WC = Pose3(pose.rotation(), pose.translation() + options.p_WScene);
  const PinholeCamera camera = scene.camera();
  for (std::size_t i = 0; i < options.correspondences; ++i) {
    const Eigen::Vector2d pixel(random.Uniform(0.0, 639.0), random.Uniform(0.0, 479.0));
    const double depth = random.Uniform(4.0, 40.0);
    const bool is_inlier = random.Uniform(0.0, 1.0) >= options.outlier_share;
    Eigen::Vector3d p_WP =
        scene.X_WC * Eigen::Vector3d(depth * camera.Unproject(pixel).value().homogeneous());
    if (!is_inlier) p_WP = scene.X_WC.translation() + random.Point(40.0);
    const Eigen::Vector2d noise(random.Normal(options.pixel_sigma_px),
                                random.Normal(options.pixel_sigma_px));
    scene.correspondences.push_back({.pixel = pixel + noise, .p_WP = p_WP});
    scene.is_inlier.push_back(is_inlier);
  }
  return scene;
}

}  // namespace relocd
