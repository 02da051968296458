#include "simulation/campus_facades.h"

#include <cmath>

namespace relocd {

void Facade::AddRectangle(const WallOpening& where, float y, std::uint32_t material, float tile_m) {
  if (!(where.width() > 0.0F) || !(where.height() > 0.0F)) return;
  const Eigen::Matrix3f R = X_HF_.linear();
  builder_.AddQuad(PointAt(where.left, y, where.bottom),
                   R.col(0) * where.width(),
                   R.col(2) * where.height(),
                   material,
                   tile_m,
                   Eigen::Vector2f(where.left, where.bottom) / tile_m);
}

void Facade::AddWall(const WallOpening& extent,
                     std::span<const WallOpening> openings,
                     std::uint32_t material,
                     float tile_m) {
  float left = extent.left;
  for (const WallOpening& opening : openings) {
    AddRectangle({left, opening.left, extent.bottom, extent.top}, 0.0F, material, tile_m);
    AddRectangle(
        {opening.left, opening.right, extent.bottom, opening.bottom}, 0.0F, material, tile_m);
    AddRectangle({opening.left, opening.right, opening.top, extent.top}, 0.0F, material, tile_m);
    left = opening.right;
  }
  AddRectangle({left, extent.right, extent.bottom, extent.top}, 0.0F, material, tile_m);
}

void Facade::AddReveals(const WallOpening& opening, float depth, std::uint32_t material) {
  const Eigen::Matrix3f R = X_HF_.linear();
  const Eigen::Vector3f inward = R.col(1) * depth;
  const Eigen::Vector3f up = R.col(2) * opening.height();
  const Eigen::Vector3f right = R.col(0) * opening.width();
  const Eigen::Vector3f corner = PointAt(opening.left, 0.0F, opening.bottom);
  builder_.AddQuad(corner, inward, up, material);
  builder_.AddQuad(corner + right + inward, -inward, up, material);
  builder_.AddQuad(corner, right, inward, material);
  builder_.AddQuad(corner + up + inward, right, -inward, material);
}

void Facade::AddFrame(const WallOpening& opening, float y, float width, std::uint32_t material) {
  AddRectangle(
      {opening.left, opening.left + width, opening.bottom, opening.top}, y, material, 2.0F);
  AddRectangle(
      {opening.right - width, opening.right, opening.bottom, opening.top}, y, material, 2.0F);
  const float left = opening.left + width;
  const float right = opening.right - width;
  AddRectangle({left, right, opening.bottom, opening.bottom + width}, y, material, 2.0F);
  AddRectangle({left, right, opening.top - width, opening.top}, y, material, 2.0F);
}

void Facade::AddWindow(const WallOpening& opening,
                       const WindowStyle& style,
                       std::uint32_t glass,
                       const PicturePart& picture) {
  constexpr float kFrame = 0.065F;
  constexpr float kBar = 0.045F;
  AddReveals(opening, style.reveal, style.surround);
  AddPicture(opening, -style.reveal, glass, picture);
  const float front = style.reveal - 0.04F;
  AddFrame(opening, front, kFrame, style.frame);
  for (int i = 1; i < style.panes_across; ++i) {
    const float x = opening.left + opening.width() * static_cast<float>(i) /
                                       static_cast<float>(style.panes_across);
    AddRectangle({x - kBar, x + kBar, opening.bottom + kFrame, opening.top - kFrame},
                 front,
                 style.frame,
                 2.0F);
  }
  for (int i = 1; i < style.panes_up; ++i) {
    const float z = opening.bottom +
                    opening.height() * static_cast<float>(i) / static_cast<float>(style.panes_up);
    AddRectangle({opening.left + kFrame, opening.right - kFrame, z - 0.025F, z + 0.025F},
                 front - 0.004F,
                 style.frame,
                 2.0F);
  }
  AddBox({opening.left - 0.08F, -0.07F, opening.bottom - 0.07F},
         {opening.right + 0.08F, 0.03F, opening.bottom},
         style.surround);
  if (style.has_moulding) {
    AddBox({opening.left - 0.12F, -0.035F, opening.bottom},
           {opening.left, 0.02F, opening.top},
           style.surround);
    AddBox({opening.right, -0.035F, opening.bottom},
           {opening.right + 0.12F, 0.02F, opening.top},
           style.surround);
    AddBox({opening.left - 0.18F, -0.08F, opening.top},
           {opening.right + 0.18F, 0.02F, opening.top + 0.15F},
           style.surround);
  }
  if (style.has_shutters) {
    const float width = 0.48F * opening.width();
    AddBox({opening.left - width - 0.03F, -0.05F, opening.bottom},
           {opening.left - 0.03F, -0.005F, opening.top},
           style.shutter,
           0.9F);
    AddBox({opening.right + 0.03F, -0.05F, opening.bottom},
           {opening.right + width + 0.03F, -0.005F, opening.top},
           style.shutter,
           0.9F);
  }
}

void Facade::AddDoor(const WallOpening& opening,
                     const WindowStyle& style,
                     const PicturePart& picture) {
  constexpr float kFrame = 0.09F;
  AddReveals(opening, style.reveal + 0.1F, style.surround);
  AddFrame(opening, style.reveal + 0.06F, kFrame, style.frame);
  AddPicture({opening.left + kFrame, opening.right - kFrame, opening.bottom, opening.top - kFrame},
             -(style.reveal + 0.075F),
             materials_.doors,
             picture);
}

void Facade::AddBox(const Eigen::Vector3f& low,
                    const Eigen::Vector3f& high,
                    std::uint32_t material,
                    float tile_m) {
  builder_.AddBox(low, high, material, tile_m, X_HF_);
}

void Facade::AddPicture(const WallOpening& where,
                        float out,
                        std::uint32_t material,
                        const PicturePart& part) {
  const Eigen::Matrix3f R = X_HF_.linear();
  builder_.AddPicture(PointAt(where.left, -out, where.bottom),
                      R.col(0) * where.width(),
                      R.col(2) * where.height(),
                      material,
                      part);
}

void Facade::AddBalcony(const WallOpening& where,
                        float depth,
                        std::uint32_t slab,
                        std::uint32_t rail) {
  constexpr float kRailHeight = 1.0F;
  constexpr float kBar = 0.02F;
  const float floor = where.bottom;
  AddBox({where.left, -depth, floor - 0.16F}, {where.right, 0.02F, floor}, slab, 2.0F);
  const float top = floor + kRailHeight;
  AddBox({where.left, -depth, top}, {where.right, -depth + 0.05F, top + 0.05F}, rail);
  AddBox({where.left, -depth + 0.05F, top}, {where.left + 0.05F, 0.0F, top + 0.05F}, rail);
  AddBox({where.right - 0.05F, -depth + 0.05F, top}, {where.right, 0.0F, top + 0.05F}, rail);
  for (float x = where.left + 0.01F; x < where.right; x += 0.16F)
    AddBox({x, -depth + 0.01F, floor}, {x + kBar, -depth + 0.01F + kBar, top}, rail);
  for (float y = -depth + 0.15F; y < 0.0F; y += 0.16F) {
    AddBox({where.left + 0.01F, y, floor}, {where.left + 0.01F + kBar, y + kBar, top}, rail);
    AddBox({where.right - 0.03F, y, floor}, {where.right - 0.03F + kBar, y + kBar, top}, rail);
  }
}

}  // namespace relocd
