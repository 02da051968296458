#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "rendering/scene.h"

namespace relocd {

/// A half-line in W, m.
struct Ray {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();
  Eigen::Vector3f direction = Eigen::Vector3f::UnitX();  ///< Of unit length.
  float near = 0.0F;  ///< Hits before this distance do not count,
  float far = 1e5F;   ///< nor after this one.
  float time = 0.0F;  ///< In [0, 1]: where between their two places moving things are.
};

/// What a ray met first.
struct Hit {
  static constexpr std::uint32_t kNothing = 0xFFFFFFFF;

  float distance = std::numeric_limits<float>::infinity();
  std::uint32_t placement = kNothing;  ///< Which mesh where; see RayTracer::SurfaceAt.
  std::uint32_t triangle = 0;
  float u = 0.0F;  ///< Barycentric: of the triangle's second
  float v = 0.0F;  ///< and third corner.

  [[nodiscard]] bool is_hit() const { return placement != kNothing; }
};

/// The surface at a hit.
struct Surface {
  Eigen::Vector3f position;          ///< In W.
  Eigen::Vector3f normal;            ///< Smooth, on the side that the ray came from.
  Eigen::Vector3f geometric_normal;  ///< Of the triangle, likewise.
  Eigen::Array3f albedo;
  const Material* material = nullptr;
};

/// A mesh on the move between two places.
struct MovingMesh {
  std::uint32_t mesh = 0;
  Eigen::Affine3f X_WM_begin = Eigen::Affine3f::Identity();  ///< At time 0
  Eigen::Affine3f X_WM_end = Eigen::Affine3f::Identity();    ///< and 1.
};

/// Finds what rays meet in a scene, by Embree. Parts of surfaces that their texture leaves out are
/// not there.
///
/// Thread-safe but for SetMoving. Borrows the scene, which must outlive it.
class RayTracer {
 public:
  /// @param more  stands still as well, besides the scene's instances.
  /// @return as Scene::Validate; kInternal when Embree fails.
  static Result<std::unique_ptr<RayTracer>> Create(const Scene& scene,
                                                   std::span<const MeshInstance> more);
  ~RayTracer();
  RayTracer(const RayTracer&) = delete;
  RayTracer& operator=(const RayTracer&) = delete;
  RayTracer(RayTracer&&) = delete;
  RayTracer& operator=(RayTracer&&) = delete;

  /// Replaces everything that moves.
  void SetMoving(std::span<const MovingMesh> moving);

  /// What each ray meets first. Rays that are near each other are traced together.
  ///
  /// @param spread  how much wider, in m per m, what one ray stands for becomes along it.
  void Intersect(std::span<const Ray> rays, float spread, std::span<Hit> hits) const;

  /// Whether each ray meets anything.
  void Occluded(std::span<const Ray> rays, float spread, std::span<std::uint8_t> occluded) const;

  /// @param hit  of this ray, and is_hit().
  [[nodiscard]] Surface SurfaceAt(const Ray& ray, const Hit& hit, float spread) const;

 private:
  RayTracer();
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace relocd
