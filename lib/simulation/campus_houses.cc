#include "simulation/campus_houses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include "simulation/campus_pictures.h"
#include "simulation/campus_textures.h"

namespace relocd {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kFoundation = 1.2F;  // How deep walls reach below the ground, which is not level.
constexpr float kDoorWidth = 1.05F;
constexpr float kDoorHeight = 2.2F;

int BaysOf(float length, float bay) {
  return std::max(1, static_cast<int>((length - 0.6F) / bay));
}

std::size_t DoorBay(const HouseStyle& style) {
  const int bays = BaysOf(style.width, style.bay);
  if (style.ground_floor == GroundFloor::kEntrance) return static_cast<std::size_t>(bays / 2);
  return static_cast<std::size_t>(style.door_part * static_cast<float>(bays));
}

/// Builds one house in its frame.
class HouseBuilder {
 public:
  HouseBuilder(const HouseStyle& style, const CampusMaterials& materials, CampusRandom random)
      : style_(style), m_(materials), random_(random) {}

  Mesh Build() {
    AddFront();
    AddPlainWall({style_.width, 0.0F, 0.0F}, 1, style_.depth, style_.is_attached);
    AddPlainWall({style_.width, style_.depth, 0.0F}, 2, style_.width, false);
    AddPlainWall({0.0F, style_.depth, 0.0F}, 3, style_.depth, style_.is_attached);
    AddRoof();
    if (style_.has_chimney) AddChimney();
    return builder_.Take();
  }

 private:
  [[nodiscard]] float eaves() const {
    return style_.plinth + static_cast<float>(style_.storeys) * style_.storey_height;
  }

  Facade FaceAt(const Vector3f& origin, int quarter_turns) {
    Eigen::Affine3f X_HF = Eigen::Affine3f::Identity();
    X_HF.translation() = origin;
    // Exact quarter turns, so that walls meet.
    constexpr std::array<float, 4> kCosine{1.0F, 0.0F, -1.0F, 0.0F};
    constexpr std::array<float, 4> kSine{0.0F, 1.0F, 0.0F, -1.0F};
    const auto i = static_cast<std::size_t>(quarter_turns);
    X_HF.linear() << kCosine.at(i), -kSine.at(i), 0.0F, kSine.at(i), kCosine.at(i), 0.0F, 0.0F,
        0.0F, 1.0F;
    return {X_HF, m_, builder_};
  }

  void AddWindow(Facade& face, const WallOpening& opening) {
    const std::uint32_t glass = random_.Chance(0.35) ? m_.lit_window : m_.window;
    face.AddWindow(opening, style_.windows, glass, kWindowPictures.Part(random_.Index(8)));
  }

  /// Windows evenly along a wall on one storey.
  std::vector<WallOpening> WindowsOf(float length, float floor) const {
    const int count = BaysOf(length, style_.bay);
    const float bay = length / static_cast<float>(count);
    const float sill = floor + std::max(0.9F, style_.storey_height - style_.window_height - 0.45F);
    std::vector<WallOpening> windows;
    for (int i = 0; i < count; ++i) {
      const float centre = bay * (static_cast<float>(i) + 0.5F);
      windows.push_back(
          {centre - 0.5F * style_.window_width,
           centre + 0.5F * style_.window_width,
           sill,
           std::min(sill + style_.window_height, floor + style_.storey_height - 0.25F)});
    }
    return windows;
  }

  void AddFront() {
    Facade face = FaceAt(Vector3f::Zero(), 0);
    face.AddWall({0.0F, style_.width, -kFoundation, style_.plinth},
                 {},
                 style_.plinth_material,
                 kTilePlaster);
    switch (style_.ground_floor) {
      case GroundFloor::kShop:
        AddShopFloor(face);
        break;
      case GroundFloor::kGarages:
        AddGarageFloor(face);
        break;
      default:
        AddDwellingFloor(face);
    }
    for (int storey = 1; storey < style_.storeys; ++storey)
      AddUpperStorey(face, storey);
    AddTrims(face);
    AddClutter(face);
  }

  void AddUpperStorey(Facade& face, int storey) {
    const float floor = style_.plinth + static_cast<float>(storey) * style_.storey_height;
    const std::vector<WallOpening> windows = WindowsOf(style_.width, floor);
    face.AddWall({0.0F, style_.width, floor, floor + style_.storey_height},
                 windows,
                 style_.wall,
                 style_.wall_tile);
    for (const WallOpening& window : windows) {
      AddWindow(face, window);
      if (random_.Chance(0.25)) {
        const float drop = random_.Uniform(0.5F, 1.1F);
        face.AddPicture({window.left - 0.05F,
                         window.right + 0.05F,
                         window.bottom - 0.07F - drop,
                         window.bottom - 0.07F},
                        0.006F,
                        m_.stains);
      }
    }
    if (style_.has_balconies && !windows.empty()) {
      for (std::size_t i = 0; i < windows.size(); i += 2)
        face.AddBalcony(
            {windows[i].left - 0.9F, windows[i].right + 0.9F, floor + 0.05F, floor + 1.1F},
            1.25F,
            m_.concrete,
            m_.dark_metal);
    }
  }

  void AddDwellingFloor(Facade& face) {
    const float floor = style_.plinth;
    std::vector<WallOpening> openings = WindowsOf(style_.width, floor);
    const bool is_grand = style_.ground_floor == GroundFloor::kEntrance;
    const std::size_t door = DoorBay(style_);
    const float centre = 0.5F * (openings[door].left + openings[door].right);
    const float width = is_grand ? 2.4F : kDoorWidth;
    openings[door] = {centre - 0.5F * width, centre + 0.5F * width, floor, floor + kDoorHeight};
    face.AddWall({0.0F, style_.width, floor, floor + style_.storey_height},
                 openings,
                 style_.ground_wall,
                 style_.wall_tile);
    for (std::size_t i = 0; i < openings.size(); ++i) {
      if (i != door) AddWindow(face, openings[i]);
    }
    AddEntrance(face, openings[door], is_grand);
  }

  void AddEntrance(Facade& face, const WallOpening& door, bool is_grand) {
    const std::size_t picture = random_.Index(static_cast<std::size_t>(kDoorPictures.size()));
    if (is_grand) {
      const float middle = 0.5F * (door.left + door.right);
      face.AddDoor(
          {door.left, middle, door.bottom, door.top}, style_.windows, kDoorPictures.Part(2));
      face.AddDoor(
          {middle, door.right, door.bottom, door.top}, style_.windows, kDoorPictures.Part(2));
      face.AddBox({door.left - 1.2F, -2.2F, door.top + 0.25F},
                  {door.right + 1.2F, 0.0F, door.top + 0.5F},
                  m_.concrete,
                  2.0F);
      face.AddPicture({door.left - 1.0F, door.right + 1.0F, door.top + 0.75F, door.top + 1.25F},
                      0.03F,
                      m_.shop_sign,
                      kShopSigns.Part(style_.sign));
    } else {
      face.AddDoor(door, style_.windows, kDoorPictures.Part(picture));
    }
    const int steps = std::max(1, static_cast<int>(std::round(style_.plinth / 0.17F)));
    const float rise = style_.plinth / static_cast<float>(steps);
    for (int i = 0; i < steps; ++i) {
      const float out = 0.3F * static_cast<float>(steps - i);
      face.AddBox({door.left - 0.2F, -out, -kFoundation},
                  {door.right + 0.2F, 0.0F, rise * static_cast<float>(i + 1)},
                  m_.stone,
                  kTilePlaster);
    }
    const float number = door.right + 0.25F;
    face.AddPicture({number, number + 0.2F, door.top - 0.5F, door.top - 0.3F},
                    0.02F,
                    m_.plates,
                    kPlates.Part(8 + random_.Index(8)));
    face.AddBox({door.left - 0.62F, -0.12F, door.bottom + 1.0F},
                {door.left - 0.28F, 0.0F, door.bottom + 1.3F},
                random_.Chance(0.5) ? m_.dark_metal : m_.metal);
    if (style_.has_porch) AddPorch(face, door);
  }

  void AddPorch(Facade& face, const WallOpening& door) {
    const float left = door.left - 0.45F;
    const float right = door.right + 0.45F;
    const float top = door.top + 0.18F;
    face.AddBox({left, -1.1F, top}, {right, 0.0F, top + 0.12F}, style_.windows.frame);
    face.AddBox({left - 0.1F, -1.2F, top + 0.12F},
                {right + 0.1F, 0.0F, top + 0.17F},
                style_.roof_material,
                kTileRoof);
    for (const float x : {left + 0.03F, right - 0.13F})
      face.AddBox({x, -1.06F, -kFoundation}, {x + 0.1F, -0.96F, top}, style_.windows.frame);
  }

  void AddShopFloor(Facade& face) {
    const float floor = style_.plinth;
    const float top = floor + 2.45F;
    const bool door_left = random_.Chance(0.5);
    const float door_from = door_left ? 0.5F : style_.width - 0.5F - kDoorWidth;
    WallOpening door{door_from, door_from + kDoorWidth, floor, top};
    const float from = door_left ? door.right + 0.4F : 0.5F;
    const float to = door_left ? style_.width - 0.5F : door.left - 0.4F;
    const int panes = std::max(1, static_cast<int>((to - from) / 2.8F));
    std::vector<WallOpening> openings;
    for (int i = 0; i < panes; ++i) {
      const float pane = (to - from) / static_cast<float>(panes);
      const float left = from + pane * static_cast<float>(i);
      openings.push_back({left + (i > 0 ? 0.1F : 0.0F),
                          left + pane - (i + 1 < panes ? 0.1F : 0.0F),
                          floor + 0.45F,
                          top});
    }
    openings.insert(door_left ? openings.begin() : openings.end(), door);
    face.AddWall({0.0F, style_.width, floor, floor + style_.storey_height},
                 openings,
                 style_.ground_wall,
                 kTilePlaster);
    WindowStyle pane = style_.windows;
    pane.has_moulding = false;
    pane.has_shutters = false;
    pane.panes_across = 1;
    pane.panes_up = 1;
    for (const WallOpening& opening : openings) {
      if (opening.bottom > floor) {
        face.AddWindow(opening, pane, m_.shop_window, kShopPictures.Part(random_.Index(8)));
      } else {
        face.AddDoor(opening, pane, kDoorPictures.Part(random_.Chance(0.5) ? 2 : 6));
        face.AddBox({door.left - 0.1F, -0.35F, -kFoundation},
                    {door.right + 0.1F, 0.0F, floor},
                    m_.stone,
                    kTilePlaster);
      }
    }
    AddShopSign(face, top);
  }

  void AddShopSign(Facade& face, float top) {
    const float height = std::min(0.62F, style_.storey_height - (top - style_.plinth) - 0.05F);
    face.AddBox({0.3F, -0.12F, top + 0.04F},
                {style_.width - 0.3F, 0.0F, top + 0.04F + height},
                style_.windows.frame);
    const float length = std::min(style_.width - 0.8F, 5.6F * height);
    const float middle = 0.5F * style_.width;
    face.AddPicture(
        {middle - 0.5F * length, middle + 0.5F * length, top + 0.07F, top + 0.01F + height},
        0.128F,
        m_.shop_sign,
        kShopSigns.Part(style_.sign));
    const float side = random_.Chance(0.5) ? 0.35F : style_.width - 0.41F;
    AddHangingSign(face, side, top + 0.85F);
    if (random_.Chance(0.45)) {
      const Vector3f left = face.PointAt(0.4F, -1.3F, top - 0.35F);
      const Vector3f right = face.PointAt(style_.width - 0.4F, -1.3F, top - 0.35F);
      const Vector3f up = face.PointAt(0.4F, -0.13F, top + 0.02F) - left;
      builder_.AddQuad(left, right - left, up, style_.windows.shutter, 0.9F);
      builder_.AddQuad(left + up, right - left, -up, style_.windows.shutter, 0.9F);
      builder_.AddQuad(left - 0.18F * Vector3f::UnitZ(),
                       right - left,
                       0.18F * Vector3f::UnitZ(),
                       style_.windows.shutter,
                       0.9F);
    }
  }

  /// A sign across the sidewalk, with its name on both sides.
  void AddHangingSign(Facade& face, float left, float bottom) {
    const float right = left + 0.06F;
    face.AddBox({left, -1.0F, bottom}, {right, -0.2F, bottom + 0.5F}, style_.windows.frame);
    face.AddBox(
        {left + 0.02F, -0.9F, bottom + 0.5F}, {right - 0.02F, 0.0F, bottom + 0.54F}, m_.dark_metal);
    const Vector3f up(0.0F, 0.0F, 0.14F);
    const Vector3f near = face.PointAt(left - 0.008F, -0.22F, bottom + 0.18F);
    const Vector3f far = face.PointAt(right + 0.008F, -0.98F, bottom + 0.18F);
    builder_.AddPicture(near, {0.0F, -0.76F, 0.0F}, up, m_.shop_sign, kShopSigns.Part(style_.sign));
    builder_.AddPicture(far, {0.0F, 0.76F, 0.0F}, up, m_.shop_sign, kShopSigns.Part(style_.sign));
  }

  void AddGarageFloor(Facade& face) {
    const int count = std::max(1, static_cast<int>(style_.width / 3.0F));
    const float bay = style_.width / static_cast<float>(count);
    std::vector<WallOpening> doors;
    for (int i = 0; i < count; ++i) {
      const float centre = bay * (static_cast<float>(i) + 0.5F);
      doors.push_back({centre - 1.22F, centre + 1.22F, style_.plinth, style_.plinth + 2.15F});
    }
    face.AddWall(
        {0.0F, style_.width, style_.plinth, eaves()}, doors, style_.wall, style_.wall_tile);
    for (const WallOpening& door : doors) {
      face.AddBox({door.left, 0.12F, door.bottom},
                  {door.right, 0.16F, door.top},
                  random_.Chance(0.3) ? m_.rusty_metal : style_.windows.shutter,
                  1.2F);
      face.AddBox({door.left - 0.02F, 0.0F, door.top - 0.06F},
                  {door.right + 0.02F, 0.14F, door.top},
                  m_.concrete);
      for (int rib = 1; rib < 5; ++rib) {
        const float z = door.bottom + 0.43F * static_cast<float>(rib);
        face.AddBox(
            {door.left + 0.05F, 0.105F, z}, {door.right - 0.05F, 0.12F, z + 0.03F}, m_.metal);
      }
      face.AddBox({door.left - 0.06F, 0.0F, door.bottom},
                  {door.left + 0.02F, 0.14F, door.top},
                  m_.concrete);
      face.AddBox({door.right - 0.02F, 0.0F, door.bottom},
                  {door.right + 0.06F, 0.14F, door.top},
                  m_.concrete);
    }
  }

  /// A wall at the side or the back.
  void AddPlainWall(const Vector3f& origin, int quarter_turns, float length, bool is_blind) {
    Facade face = FaceAt(origin, quarter_turns);
    face.AddWall(
        {0.0F, length, -kFoundation, style_.plinth}, {}, style_.plinth_material, kTilePlaster);
    for (int storey = 0; storey < style_.storeys; ++storey) {
      const float floor = style_.plinth + static_cast<float>(storey) * style_.storey_height;
      std::vector<WallOpening> windows;
      if (!is_blind && style_.ground_floor != GroundFloor::kGarages) {
        for (const WallOpening& window : WindowsOf(length, floor)) {
          if (style_.ground_floor == GroundFloor::kEntrance || random_.Chance(0.6))
            windows.push_back(window);
        }
      }
      const std::uint32_t wall = storey == 0 && style_.ground_floor != GroundFloor::kShop
                                     ? style_.ground_wall
                                     : style_.wall;
      face.AddWall(
          {0.0F, length, floor, floor + style_.storey_height}, windows, wall, style_.wall_tile);
      for (const WallOpening& window : windows)
        AddWindow(face, window);
    }
    AddSideClutter(face, length);
  }

  void AddSideClutter(Facade& face, float length) {
    if (random_.Chance(0.3)) {
      const float left = random_.Uniform(0.3F, 0.4F * length);
      const float height = random_.Uniform(0.5F, 0.95F) * eaves();
      AddIvy(face, {left, left + random_.Uniform(1.5F, 3.5F), 0.0F, height});
    }
    for (float x = 0.3F; x + 1.2F < length; x += random_.Uniform(1.5F, 4.0F)) {
      const float width = random_.Uniform(0.8F, 2.2F);
      const float height = random_.Uniform(0.8F, 2.4F);
      if (x + width < length)
        face.AddPicture({x, x + width, eaves() - height, eaves() - 0.05F}, 0.007F, m_.stains);
    }
    if (style_.is_attached) AddAdvertisement(face, length);
    if (random_.Chance(0.5)) {
      const float x = random_.Uniform(0.5F, length - 1.2F);
      const float z = random_.Uniform(0.6F, 2.2F);
      face.AddBox({x, -0.22F, z}, {x + 0.5F, 0.0F, z + 0.7F}, m_.metal);
    }
  }

  /// What is painted or hung on the bare walls at the ends of rows.
  void AddAdvertisement(Facade& face, float length) {
    const float kind = random_.Unit();
    const float left = random_.Uniform(0.8F, 0.3F * length);
    if (kind < 0.4F) {
      const float width = std::min(0.6F * length, length - left - 0.5F);
      const float bottom = random_.Uniform(2.8F, std::max(2.9F, eaves() - 2.0F));
      face.AddPicture({left, left + width, bottom, bottom + width / 6.0F},
                      0.012F,
                      m_.shop_sign,
                      kShopSigns.Part(random_.Index(23)));
    } else if (kind < 0.8F) {
      const float side = random_.Uniform(1.6F, 2.4F);
      face.AddBox(
          {left - 0.08F, -0.06F, 1.12F}, {left + side + 0.08F, 0.0F, 1.28F + side}, m_.dark_metal);
      face.AddPicture({left, left + side, 1.2F, 1.2F + side},
                      0.068F,
                      m_.posters,
                      kPosters.Part(random_.Index(16)));
    }
  }

  void AddIvy(Facade& face, const WallOpening& extent) {
    const int cards = static_cast<int>(3.5F * extent.width() * extent.height());
    for (int i = 0; i < cards; ++i) {
      const float up = random_.Unit();
      // Narrower towards its top.
      const float spread = 0.5F * extent.width() * (1.0F - 0.6F * up * up);
      const float x = 0.5F * (extent.left + extent.right) + random_.Uniform(-spread, spread);
      const float z = extent.bottom + up * extent.height();
      const float half = random_.Uniform(0.28F, 0.5F);
      face.AddPicture(
          {x - half, x + half, z - half, z + half}, random_.Uniform(0.02F, 0.10F), m_.ivy);
    }
  }

  void AddTrims(Facade& face) {
    if (style_.has_bands) {
      for (int storey = 1; storey < style_.storeys; ++storey) {
        const float z = style_.plinth + static_cast<float>(storey) * style_.storey_height;
        face.AddBox({-0.03F, -0.06F, z - 0.16F},
                    {style_.width + 0.03F, 0.01F, z + 0.04F},
                    style_.windows.surround,
                    2.0F);
      }
    }
    if (style_.has_cornice && style_.roof != RoofShape::kCrossGable) {
      const float z = eaves();
      face.AddBox({-0.04F, -0.14F, z - 0.30F},
                  {style_.width + 0.04F, 0.01F, z - 0.12F},
                  style_.windows.surround,
                  2.0F);
      face.AddBox({-0.08F, -0.26F, z - 0.12F},
                  {style_.width + 0.08F, 0.01F, z},
                  style_.windows.surround,
                  2.0F);
    }
    if (style_.plinth > 0.2F)
      face.AddBox({0.0F, -0.025F, style_.plinth - 0.07F},
                  {style_.width, 0.01F, style_.plinth},
                  m_.stone,
                  2.0F);
    const float pipe = random_.Chance(0.5) ? 0.12F : style_.width - 0.2F;
    face.AddBox({pipe, -0.10F, 0.05F},
                {pipe + 0.08F, -0.02F, eaves() - 0.1F},
                random_.Chance(0.5) ? m_.metal : m_.dark_metal);
    for (float z = 0.8F; z < eaves() - 0.4F; z += 1.6F)
      face.AddBox({pipe - 0.02F, -0.11F, z}, {pipe + 0.10F, 0.0F, z + 0.04F}, m_.dark_metal);
  }

  void AddClutter(Facade& face) {
    const float floor = style_.plinth;
    if (style_.ground_floor == GroundFloor::kShop || random_.Chance(0.15)) {
      const float x = random_.Chance(0.5) ? 0.02F : style_.width - 0.45F;
      face.AddPicture({x, x + 0.42F, floor + 1.05F, floor + 1.65F},
                      0.012F,
                      m_.posters,
                      kPosters.Part(random_.Index(16)));
    }
    if (random_.Chance(0.4)) {
      const float x = random_.Uniform(0.2F, style_.width - 0.7F);
      face.AddBox(
          {x, -0.1F, 0.05F}, {x + 0.4F, 0.0F, 0.05F + random_.Uniform(0.25F, 0.5F)}, m_.metal);
    }
    for (float x = 0.1F; x + 0.6F < style_.width; x += random_.Uniform(1.2F, 3.5F)) {
      const float width = random_.Uniform(0.6F, 1.6F);
      const float height = random_.Uniform(0.5F, 1.6F);
      if (x + width < style_.width && random_.Chance(0.6))
        face.AddPicture(
            {x, x + width, eaves() - 0.32F - height, eaves() - 0.31F}, 0.007F, m_.stains);
    }
    if (!style_.is_attached && style_.ground_floor == GroundFloor::kDwelling &&
        random_.Chance(0.18)) {
      const float x = random_.Chance(0.5) ? 0.1F : style_.width - 2.3F;
      AddIvy(face, {x, x + 2.2F, 0.0F, random_.Uniform(0.5F, 0.9F) * eaves()});
    }
  }

  /// A sloping slab seen from both sides; `across` x `up` points outwards.
  void AddSlope(const Vector3f& corner, const Vector3f& across, const Vector3f& up) {
    constexpr float kThickness = 0.14F;
    const Vector3f down = -kThickness * Vector3f::UnitZ();
    builder_.AddQuad(corner, across, up, style_.roof_material, kTileRoof);
    builder_.AddQuad(corner + up + down, across, -up, style_.windows.frame, 2.0F);
    builder_.AddQuad(corner + down, across, -down, style_.windows.frame, 2.0F);
    builder_.AddQuad(corner + up + down, -up, -down, style_.windows.frame, 2.0F);
    builder_.AddQuad(corner + across + down, up, -down, style_.windows.frame, 2.0F);
  }

  void AddRoof() {
    switch (style_.roof) {
      case RoofShape::kFlat:
        AddFlatRoof();
        break;
      case RoofShape::kCrossGable:
        AddCrossGable();
        break;
      case RoofShape::kHip:
        AddHip();
        break;
      case RoofShape::kGable:
        AddGable();
    }
  }

  void AddGableWall(const Vector3f& left, const Vector3f& right, const Vector3f& top) {
    const float width = (right - left).norm();
    const float tile = style_.wall_tile;
    builder_.AddTriangle({left, right, top},
                         {Vector2f(0.0F, -left.z() / tile),
                          Vector2f(width / tile, -left.z() / tile),
                          Vector2f(0.5F * width / tile, -top.z() / tile)},
                         style_.wall);
  }

  void AddGable() {
    const float over = style_.is_attached ? 0.0F : 0.35F;
    const float out = 0.45F;
    const float z = eaves();
    const float run = 0.5F * style_.depth;
    const float rise = run * style_.roof_pitch;
    const float drop = out * style_.roof_pitch;
    const Vector3f along(style_.width + 2.0F * over, 0.0F, 0.0F);
    AddSlope({-over, -out, z - drop + 0.1F}, along, {0.0F, run + out, rise + drop});
    AddSlope({style_.width + over, style_.depth + out, z - drop + 0.1F},
             -along,
             {0.0F, -run - out, rise + drop});
    AddGableWall(
        {style_.width, 0.0F, z}, {style_.width, style_.depth, z}, {style_.width, run, z + rise});
    AddGableWall({0.0F, style_.depth, z}, {0.0F, 0.0F, z}, {0.0F, run, z + rise});
    builder_.AddBox({-over, -out - 0.12F, z - drop - 0.02F},
                    {style_.width + over, -out, z - drop + 0.09F},
                    m_.metal);
    if (style_.has_dormers) AddDormers(z, run);
  }

  void AddDormers(float z, float run) {
    const int count = std::max(1, static_cast<int>(style_.width / 4.0F));
    for (int i = 0; i < count; ++i) {
      const float centre =
          style_.width * (static_cast<float>(i) + 0.5F) / static_cast<float>(count);
      const float front = 0.16F * run;
      const float bottom = z + front * style_.roof_pitch;
      const float left = centre - 0.75F;
      Facade face = FaceAt({left, front, bottom}, 0);
      const std::array<WallOpening, 1> window{{{0.25F, 1.25F, 0.25F, 1.3F}}};
      face.AddWall({0.0F, 1.5F, -0.2F, 1.5F}, window, style_.wall, style_.wall_tile);
      AddWindow(face, window[0]);
      const float depth = std::min(1.5F / style_.roof_pitch, run - front);
      for (const float x : {0.0F, 1.42F})
        face.AddBox({x, 0.01F, -0.2F}, {x + 0.08F, depth, 1.5F}, style_.wall, style_.wall_tile);
      face.AddBox({-0.15F, -0.2F, 1.5F}, {1.65F, depth + 0.1F, 1.62F}, m_.flat_roof, 2.0F);
    }
  }

  void AddCrossGable() {
    const float over = 0.4F;
    const float out = 0.4F;
    const float z = eaves();
    const float run = 0.5F * style_.width;
    const float rise = run * style_.roof_pitch;
    const float drop = over * style_.roof_pitch;
    const Vector3f along(0.0F, style_.depth + 2.0F * out, 0.0F);
    AddSlope({-over, style_.depth + out, z - drop + 0.1F}, -along, {run + over, 0.0F, rise + drop});
    AddSlope({style_.width + over, -out, z - drop + 0.1F}, along, {-run - over, 0.0F, rise + drop});
    AddGableWall({0.0F, 0.0F, z}, {style_.width, 0.0F, z}, {run, 0.0F, z + rise});
    AddGableWall(
        {style_.width, style_.depth, z}, {0.0F, style_.depth, z}, {run, style_.depth, z + rise});
    Facade face = FaceAt({run - 0.5F, -0.03F, z + 0.25F}, 0);
    WindowStyle small = style_.windows;
    small.has_shutters = false;
    small.reveal = 0.05F;
    face.AddWindow(
        {0.0F, 1.0F, 0.0F, 1.2F}, small, m_.window, kWindowPictures.Part(random_.Index(8)));
  }

  void AddHip() {
    const float out = 0.45F;
    const float z = eaves() - out * style_.roof_pitch + 0.1F;
    const float run = 0.5F * std::min(style_.depth, style_.width) + out;
    const float top = z + run * style_.roof_pitch;
    const Vector3f a(-out, -out, z);
    const Vector3f b(style_.width + out, -out, z);
    const Vector3f c(style_.width + out, style_.depth + out, z);
    const Vector3f d(-out, style_.depth + out, z);
    const bool is_long = style_.width >= style_.depth;
    const Vector3f first =
        is_long ? Vector3f(-out + run, -out + run, top) : Vector3f(-out + run, -out + run, top);
    const Vector3f last = is_long ? Vector3f(style_.width + out - run, -out + run, top)
                                  : Vector3f(-out + run, style_.depth + out - run, top);
    const auto face = [&](const std::array<Vector3f, 3>& p) {
      const Vector3f u = (p[1] - p[0]).normalized();
      const Vector3f v = (p[1] - p[0]).cross(p[2] - p[0]).normalized().cross(u);
      const auto uv = [&](const Vector3f& q) -> Vector2f {
        return Vector2f(u.dot(q), -v.dot(q)) / kTileRoof;
      };
      builder_.AddTriangle(p, {uv(p[0]), uv(p[1]), uv(p[2])}, style_.roof_material);
    };
    if (is_long) {
      face({a, b, last});
      face({a, last, first});
      face({b, c, last});
      face({c, d, first});
      face({c, first, last});
      face({d, a, first});
    } else {
      face({a, b, first});
      face({b, c, last});
      face({b, last, first});
      face({c, d, last});
      face({d, a, first});
      face({d, first, last});
    }
    builder_.AddBox({-out, -out, z - 0.14F},
                    {style_.width + out, style_.depth + out, z - 0.005F},
                    style_.windows.frame,
                    2.0F);
  }

  void AddFlatRoof() {
    const float z = eaves();
    constexpr float kParapet = 0.45F;
    constexpr float kThickness = 0.25F;
    builder_.AddQuad({0.0F, 0.0F, z},
                     {style_.width, 0.0F, 0.0F},
                     {0.0F, style_.depth, 0.0F},
                     m_.flat_roof,
                     kTileAsphalt);
    const auto parapet = [&](const Vector2f& low, const Vector2f& high) {
      builder_.AddBox({low.x(), low.y(), z - 0.01F},
                      {high.x(), high.y(), z + kParapet},
                      style_.wall,
                      style_.wall_tile);
      builder_.AddBox({low.x() - 0.04F, low.y() - 0.04F, z + kParapet},
                      {high.x() + 0.04F, high.y() + 0.04F, z + kParapet + 0.07F},
                      m_.metal);
    };
    parapet({0.0F, 0.0F}, {style_.width, kThickness});
    parapet({0.0F, style_.depth - kThickness}, {style_.width, style_.depth});
    parapet({0.0F, kThickness}, {kThickness, style_.depth - kThickness});
    parapet({style_.width - kThickness, kThickness}, {style_.width, style_.depth - kThickness});
    if (style_.storeys > 2) {
      const float x = random_.Uniform(0.3F, 0.6F) * style_.width;
      builder_.AddBox({x, 0.5F * style_.depth, z},
                      {x + 2.6F, 0.5F * style_.depth + 2.2F, z + 1.8F},
                      m_.metal,
                      2.0F);
    }
  }

  void AddChimney() {
    const float x = random_.Uniform(0.15F, 0.8F) * style_.width;
    const float y = 0.5F * style_.depth + random_.Uniform(-0.6F, 0.2F);
    const float top =
        eaves() + (style_.roof == RoofShape::kFlat
                       ? 1.4F
                       : 0.5F * style_.depth * style_.roof_pitch + random_.Uniform(0.6F, 1.1F));
    builder_.AddBox(
        {x, y, eaves()}, {x + 0.6F, y + 0.6F, top}, m_.bricks[random_.Index(3)], kTileBrick);
    builder_.AddBox({x - 0.06F, y - 0.06F, top}, {x + 0.66F, y + 0.66F, top + 0.1F}, m_.concrete);
    for (const float pot : {0.16F, 0.44F})
      builder_.AddCylinder({x + pot, y + 0.3F, top + 0.1F}, 0.1F, 0.08F, 0.35F, 7, m_.roofs[0]);
  }

  const HouseStyle& style_;
  const CampusMaterials& m_;
  CampusRandom random_;
  MeshBuilder builder_;
};

}  // namespace

float DoorCentre(const HouseStyle& style) {
  const auto bays = static_cast<float>(BaysOf(style.width, style.bay));
  return style.width / bays * (static_cast<float>(DoorBay(style)) + 0.5F);
}

Mesh MakeHouse(const HouseStyle& style, const CampusMaterials& materials, CampusRandom random) {
  return HouseBuilder(style, materials, random).Build();
}

}  // namespace relocd
