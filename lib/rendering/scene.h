#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/result.h"
#include "rendering/texture.h"

namespace relocd {

/// How a surface answers light. Colours are linear red, green, blue.
struct Material {
  std::string name;  ///< For error messages.
  int texture = -1;  ///< Index into the scene's textures; -1: `albedo` alone.
  Eigen::Array3f albedo = Eigen::Array3f::Constant(0.5F);  ///< Multiplies the texture.
  Eigen::Array3f emission = Eigen::Array3f::Zero();  ///< Radiance of its own, when lamps are on.
  float alpha_cutoff =
      0.0F;  ///< > 0: there is no surface where coverage is below, as between leaves.
  float translucency =
      0.0F;  ///< Part of the light that comes through, as through leaves, in [0, 1].
  float reflectivity =
      0.0F;  ///< Mirror reflection at normal incidence (0.04 for glass), in [0, 1].
  float wet_reflectivity = 0.0F;  ///< The same when the surface is wet.
  float wet_darkening = 0.0F;     ///< Part of the albedo that a wet surface loses.
};

/// Triangles in a frame of their own.
struct Mesh {
  std::vector<Eigen::Vector3f> positions;  ///< m
  std::vector<Eigen::Vector3f> normals;    ///< Empty (flat triangles), or one for each position.
  std::vector<Eigen::Vector2f> uvs;        ///< Empty, or one for each position.
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< Counter-clockwise seen from outside.
  std::vector<std::uint32_t> triangle_materials;        ///< Index into the scene's, per triangle.
};

/// A mesh, placed. `X_WM` may scale.
struct MeshInstance {
  std::uint32_t mesh = 0;
  Eigen::Affine3f X_WM = Eigen::Affine3f::Identity();
};

/// A lamp that shines downwards into a cone, when lamps are on.
struct Lamp {
  Eigen::Vector3f p_WL = Eigen::Vector3f::Zero();
  Eigen::Array3f intensity = Eigen::Array3f::Constant(8.0F);  ///< Irradiance at 1 m.
  float cone_cosine = 0.3F;  ///< Of the angle from straight down at which it ends.
};

/// Everything that stands still: meshes are shared by their instances. z is up, lengths in metres.
struct Scene {
  std::vector<Texture> textures;
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
  std::vector<MeshInstance> instances;
  std::vector<Lamp> lamps;

  std::uint32_t AddTexture(Texture texture);
  std::uint32_t AddMaterial(Material material);
  std::uint32_t AddMesh(Mesh mesh);

  /// @return kInvalidInput for an index out of range, counts that do not fit each other, or numbers
  ///         that are not finite, with the mesh's or material's index.
  [[nodiscard]] Result<void> Validate() const;

  [[nodiscard]] std::size_t CountTriangles() const;  ///< Of all instances.
};

}  // namespace relocd
