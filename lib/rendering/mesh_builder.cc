#include "rendering/mesh_builder.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

namespace relocd {

// A shape is these numbers.
void MeshBuilder::AddQuad(  // NOLINT(readability-function-size)
    const Eigen::Vector3f& corner,
    const Eigen::Vector3f& edge_u,
    const Eigen::Vector3f& edge_v,
    std::uint32_t material,
    float tile_m,
    const Eigen::Vector2f& uv_origin) {
  const Eigen::Vector2f size(edge_u.norm() / tile_m, edge_v.norm() / tile_m);
  AddQuadWithUvs(corner, edge_u, edge_v, uv_origin, uv_origin + size, material);
}

void MeshBuilder::AddPicture(const Eigen::Vector3f& corner,
                             const Eigen::Vector3f& edge_u,
                             const Eigen::Vector3f& edge_v,
                             std::uint32_t material,
                             const PicturePart& part) {
  AddQuadWithUvs(corner, edge_u, edge_v, part.low, part.high, material);
}

// A shape is these numbers.
void MeshBuilder::AddQuadWithUvs(  // NOLINT(readability-function-size)
    const Eigen::Vector3f& corner,
    const Eigen::Vector3f& edge_u,
    const Eigen::Vector3f& edge_v,
    const Eigen::Vector2f& uv_low,
    const Eigen::Vector2f& uv_high,
    std::uint32_t material) {
  const Eigen::Vector3f normal = edge_u.cross(edge_v).normalized();
  // v goes down the image.
  const std::uint32_t a = AddVertex(corner, normal, {uv_low.x(), 1.0F - uv_low.y()});
  const std::uint32_t b = AddVertex(corner + edge_u, normal, {uv_high.x(), 1.0F - uv_low.y()});
  const std::uint32_t c =
      AddVertex(corner + edge_u + edge_v, normal, {uv_high.x(), 1.0F - uv_high.y()});
  const std::uint32_t d = AddVertex(corner + edge_v, normal, {uv_low.x(), 1.0F - uv_high.y()});
  AddFace(a, b, c, material);
  AddFace(a, c, d, material);
}

void MeshBuilder::AddBox(const Eigen::Vector3f& low,
                         const Eigen::Vector3f& high,
                         std::uint32_t material,
                         float tile_m,
                         const Eigen::Affine3f& X_MB) {
  const Eigen::Vector3f size = high - low;
  const Eigen::Matrix3f axes = X_MB.linear();
  const Eigen::Vector3f x = axes.col(0) * size.x();
  const Eigen::Vector3f y = axes.col(1) * size.y();
  const Eigen::Vector3f z = axes.col(2) * size.z();
  const Eigen::Vector3f o = X_MB * low;
  AddQuad(o, x, z, material, tile_m);
  AddQuad(o + x, y, z, material, tile_m);
  AddQuad(o + x + y, -x, z, material, tile_m);
  AddQuad(o + y, -y, z, material, tile_m);
  AddQuad(o + z, x, y, material, tile_m);
  AddQuad(o, y, x, material, tile_m);
}

void MeshBuilder::AddTriangle(const std::array<Eigen::Vector3f, 3>& corners,
                              const std::array<Eigen::Vector2f, 3>& uvs,
                              std::uint32_t material) {
  const Eigen::Vector3f normal =
      (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  const std::uint32_t a = AddVertex(corners[0], normal, uvs[0]);
  const std::uint32_t b = AddVertex(corners[1], normal, uvs[1]);
  const std::uint32_t c = AddVertex(corners[2], normal, uvs[2]);
  AddFace(a, b, c, material);
}

// A shape is these numbers.
void MeshBuilder::AddCylinder(  // NOLINT(readability-function-size)
    const Eigen::Vector3f& base,
    float radius_m,
    float top_radius_m,
    float height_m,
    int sides,
    std::uint32_t material,
    float tile_m) {
  const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
  for (int i = 0; i <= sides; ++i) {
    const float angle =
        2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(sides);
    const Eigen::Vector3f outward(std::cos(angle), std::sin(angle), 0.0F);
    const float u = angle * radius_m / tile_m;
    AddVertex(base + radius_m * outward, outward, {u, 0.0F});
    AddVertex(base + top_radius_m * outward + height_m * Eigen::Vector3f::UnitZ(),
              outward,
              {u, -height_m / tile_m});
  }
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(sides); ++i) {
    const std::uint32_t a = first + 2 * i;
    AddFace(a, a + 2, a + 3, material);
    AddFace(a, a + 3, a + 1, material);
  }
}

void MeshBuilder::AddGrid(std::span<const Eigen::Vector3f> points,
                          int rows,
                          int columns,
                          std::uint32_t material,
                          float tile_m) {
  const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
  const auto at = [&](int row, int column) {
    row = std::clamp(row, 0, rows - 1);
    column = std::clamp(column, 0, columns - 1);
    return points[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                  static_cast<std::size_t>(column)];
  };
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Eigen::Vector3f p = at(row, column);
      const Eigen::Vector3f along_columns = at(row, column + 1) - at(row, column - 1);
      const Eigen::Vector3f along_rows = at(row + 1, column) - at(row - 1, column);
      AddVertex(p, along_columns.cross(along_rows).normalized(), p.head<2>() / tile_m);
    }
  }
  const auto index = [&](int row, int column) {
    return first + static_cast<std::uint32_t>(row * columns + column);
  };
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      AddFace(index(row, column), index(row, column + 1), index(row + 1, column + 1), material);
      AddFace(index(row, column), index(row + 1, column + 1), index(row + 1, column), material);
    }
  }
}

std::uint32_t MeshBuilder::AddVertex(const Eigen::Vector3f& position,
                                     const Eigen::Vector3f& normal,
                                     const Eigen::Vector2f& uv) {
  mesh_.positions.push_back(position);
  mesh_.normals.push_back(normal);
  mesh_.uvs.push_back(uv);
  return static_cast<std::uint32_t>(mesh_.positions.size() - 1);
}

void MeshBuilder::AddFace(std::uint32_t a,
                          std::uint32_t b,
                          std::uint32_t c,
                          std::uint32_t material) {
  mesh_.triangles.push_back({a, b, c});
  mesh_.triangle_materials.push_back(material);
}

}  // namespace relocd
