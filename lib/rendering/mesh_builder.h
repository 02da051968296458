#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rendering/scene.h"

namespace relocd {

/// A part of a picture: u to the right and v up from its lower left corner, each in [0, 1].
struct PicturePart {
  Eigen::Vector2f low = Eigen::Vector2f::Zero();
  Eigen::Vector2f high = Eigen::Vector2f::Ones();
};

/// Puts a mesh together from simple shapes. Vertices are not shared between shapes, so that edges
/// are sharp. Colours come from materials; texture coordinates are metres divided by `tile_m`, so
/// that a texture keeps its scale on walls of all sizes.
class MeshBuilder {
 public:
  /// A parallelogram from `corner` along two edges; its outside is where `edge_u` x `edge_v`
  /// points. u runs along `edge_u`, v against `edge_v` (so that with `edge_v` up, images stand
  /// upright).
  ///
  /// @param tile_m  metres that one repetition of the texture covers.
  /// @param uv_origin  of the lower left corner, in repetitions.
  void AddQuad(const Eigen::Vector3f& corner,
               const Eigen::Vector3f& edge_u,
               const Eigen::Vector3f& edge_v,
               std::uint32_t material,
               float tile_m = 1.0F,
               const Eigen::Vector2f& uv_origin = Eigen::Vector2f::Zero());

  /// The same with the whole texture, or a part of it, stretched over it once.
  void AddPicture(const Eigen::Vector3f& corner,
                  const Eigen::Vector3f& edge_u,
                  const Eigen::Vector3f& edge_v,
                  std::uint32_t material,
                  const PicturePart& part = {});

  /// A box with sides along the axes of `X_MB`, from `low` to `high`.
  void AddBox(const Eigen::Vector3f& low,
              const Eigen::Vector3f& high,
              std::uint32_t material,
              float tile_m = 1.0F,
              const Eigen::Affine3f& X_MB = Eigen::Affine3f::Identity());

  /// A triangle with corners given counter-clockwise and their texture coordinates.
  void AddTriangle(const std::array<Eigen::Vector3f, 3>& corners,
                   const std::array<Eigen::Vector2f, 3>& uvs,
                   std::uint32_t material);

  /// An upright prism (a post, a trunk) round `base`, narrowing from one radius to the other.
  void AddCylinder(const Eigen::Vector3f& base,
                   float radius_m,
                   float top_radius_m,
                   float height_m,
                   int sides,
                   std::uint32_t material,
                   float tile_m = 1.0F);

  /// A grid of `rows` x `columns` points, row-major, with smooth normals, as of terrain; its
  /// outside is where (next column) x (next row) points. Texture coordinates are x and y over
  /// `tile_m`.
  void AddGrid(std::span<const Eigen::Vector3f> points,
               int rows,
               int columns,
               std::uint32_t material,
               float tile_m);

  [[nodiscard]] bool empty() const { return mesh_.triangles.empty(); }
  [[nodiscard]] const Mesh& mesh() const { return mesh_; }
  Mesh Take() { return std::move(mesh_); }

 private:
  std::uint32_t AddVertex(const Eigen::Vector3f& position,
                          const Eigen::Vector3f& normal,
                          const Eigen::Vector2f& uv);
  void AddFace(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t material);
  void AddQuadWithUvs(const Eigen::Vector3f& corner,
                      const Eigen::Vector3f& edge_u,
                      const Eigen::Vector3f& edge_v,
                      const Eigen::Vector2f& uv_low,
                      const Eigen::Vector2f& uv_high,
                      std::uint32_t material);

  Mesh mesh_;
};

}  // namespace relocd
