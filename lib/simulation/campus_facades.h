#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rendering/mesh_builder.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_random.h"

namespace relocd {

/// A hole in a wall, in the wall's plane: x to the right, z up, m.
struct WallOpening {
  float left = 0.0F;
  float right = 1.0F;
  float bottom = 0.0F;
  float top = 1.0F;

  [[nodiscard]] float width() const { return right - left; }
  [[nodiscard]] float height() const { return top - bottom; }
};

/// How the windows of a house look.
struct WindowStyle {
  std::uint32_t frame = 0;     ///< Material.
  std::uint32_t surround = 0;  ///< Material of sills, and of mouldings where there are any.
  int panes_across = 2;
  int panes_up = 1;
  bool has_moulding = false;
  bool has_shutters = false;
  std::uint32_t shutter = 0;  ///< Material.
  float reveal = 0.13F;       ///< How deep the glass lies in the wall, m.
};

/// One plane wall of a building and what is in and on it. Its frame F: x to the right as seen from
/// outside, y into the building, z up, so that what sticks out has y < 0.
class Facade {
 public:
  Facade(const Eigen::Affine3f& X_HF, const CampusMaterials& materials, MeshBuilder& builder)
      : X_HF_(X_HF), materials_(materials), builder_(builder) {}

  /// A rectangle of wall around openings that do not overlap and are ordered by their left edge.
  void AddWall(const WallOpening& extent,
               std::span<const WallOpening> openings,
               std::uint32_t material,
               float tile_m);

  void AddWindow(const WallOpening& opening,
                 const WindowStyle& style,
                 std::uint32_t glass,
                 const PicturePart& picture);

  /// A door with its frame; `picture` of the materials' doors.
  void AddDoor(const WallOpening& opening, const WindowStyle& style, const PicturePart& picture);

  /// A box by its corners in F.
  void AddBox(const Eigen::Vector3f& low,
              const Eigen::Vector3f& high,
              std::uint32_t material,
              float tile_m = 1.0F);

  /// A picture that lies `out` m before the wall.
  void AddPicture(const WallOpening& where,
                  float out,
                  std::uint32_t material,
                  const PicturePart& part = {});

  /// A slab with a railing round it, `depth` m wide.
  void AddBalcony(const WallOpening& where, float depth, std::uint32_t slab, std::uint32_t rail);

  [[nodiscard]] const CampusMaterials& materials() const { return materials_; }
  [[nodiscard]] Eigen::Vector3f PointAt(float x, float y, float z) const {
    return X_HF_ * Eigen::Vector3f(x, y, z);
  }

 private:
  void AddRectangle(const WallOpening& where, float y, std::uint32_t material, float tile_m);
  void AddReveals(const WallOpening& opening, float depth, std::uint32_t material);
  void AddFrame(const WallOpening& opening, float y, float width, std::uint32_t material);

  Eigen::Affine3f X_HF_;
  const CampusMaterials& materials_;
  MeshBuilder& builder_;
};

}  // namespace relocd
