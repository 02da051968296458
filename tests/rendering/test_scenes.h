#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "camera/intrinsics.h"
#include "rendering/lighting.h"
#include "rendering/mesh_builder.h"
#include "rendering/scene.h"

namespace relocd {

/// A material that shines by itself, whatever the light, when lamps are on.
inline std::uint32_t AddShining(Scene& scene, float radiance) {
  Material material;
  material.albedo = Eigen::Array3f::Zero();
  material.emission = Eigen::Array3f::Constant(radiance);
  return scene.AddMaterial(material);
}

inline std::uint32_t AddPlain(Scene& scene, float albedo) {
  Material material;
  material.albedo = Eigen::Array3f::Constant(albedo);
  return scene.AddMaterial(material);
}

inline void Place(Scene& scene, MeshBuilder& builder) {
  scene.instances.push_back({.mesh = scene.AddMesh(builder.Take())});
}

/// Neither sun nor sky: only what shines by itself is seen.
inline LightingOptions NoLight() {
  LightingOptions options;
  options.sun_strength = 0.0;
  options.sky_brightness = 0.0;
  options.lamps_on = true;
  return options;
}

inline CameraIntrinsics TestIntrinsics() {
  return {.fx = 210.0, .fy = 205.0, .cx = 161.3, .cy = 118.2, .width = 320, .height = 240};
}

/// A camera with the distortion of a usual wide-angle lens.
inline CameraIntrinsics DistortedIntrinsics() {
  CameraIntrinsics intrinsics = TestIntrinsics();
  intrinsics.distortion = {-0.25, 0.07, 0.001, -0.0007, -0.008};
  return intrinsics;
}

/// A sphere of triangles whose corners lie on it.
inline void AddSphere(MeshBuilder& builder,
                      const Eigen::Vector3f& middle,
                      float radius_m,
                      int rings,
                      std::uint32_t material) {
  constexpr float kPi = 3.14159265F;
  const auto at = [&](int ring, int segment) -> Eigen::Vector3f {
    const float polar = kPi * static_cast<float>(ring) / static_cast<float>(rings);
    const float azimuth = kPi * static_cast<float>(segment) / static_cast<float>(rings);
    return middle + radius_m * Eigen::Vector3f(std::sin(polar) * std::cos(azimuth),
                                               std::sin(polar) * std::sin(azimuth),
                                               std::cos(polar));
  };
  const std::array<Eigen::Vector2f, 3> no_uvs{
      Eigen::Vector2f::Zero(), Eigen::Vector2f::Zero(), Eigen::Vector2f::Zero()};
  for (int ring = 0; ring < rings; ++ring) {
    for (int segment = 0; segment < 2 * rings; ++segment) {
      const Eigen::Vector3f a = at(ring, segment);
      const Eigen::Vector3f b = at(ring + 1, segment);
      const Eigen::Vector3f c = at(ring + 1, segment + 1);
      const Eigen::Vector3f d = at(ring, segment + 1);
      if (ring + 1 < rings) builder.AddTriangle({a, b, c}, no_uvs, material);
      if (ring > 0) builder.AddTriangle({a, c, d}, no_uvs, material);
    }
  }
}

}  // namespace relocd
