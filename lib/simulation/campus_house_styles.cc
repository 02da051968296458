#include <array>
#include <cmath>

#include "simulation/campus_houses.h"
#include "simulation/campus_textures.h"

namespace relocd {
namespace {

using Colour = Eigen::Array3f;

const std::array<Colour, 10>& PlasterColours() {
  static const std::array<Colour, 10> colours{{{0.93F, 0.90F, 0.82F},
                                               {0.90F, 0.83F, 0.67F},
                                               {0.86F, 0.76F, 0.66F},
                                               {0.80F, 0.82F, 0.80F},
                                               {0.92F, 0.92F, 0.90F},
                                               {0.79F, 0.73F, 0.64F},
                                               {0.73F, 0.78F, 0.76F},
                                               {0.88F, 0.79F, 0.74F},
                                               {0.70F, 0.70F, 0.68F},
                                               {0.84F, 0.80F, 0.60F}}};
  return colours;
}

const std::array<Colour, 7>& BoardColours() {
  static const std::array<Colour, 7> colours{{{0.90F, 0.90F, 0.88F},
                                              {0.68F, 0.74F, 0.76F},
                                              {0.82F, 0.77F, 0.64F},
                                              {0.57F, 0.34F, 0.29F},
                                              {0.60F, 0.66F, 0.58F},
                                              {0.45F, 0.49F, 0.53F},
                                              {0.78F, 0.72F, 0.68F}}};
  return colours;
}

const std::array<Colour, 6>& PaintColours() {
  static const std::array<Colour, 6> colours{{{0.26F, 0.36F, 0.30F},
                                              {0.30F, 0.36F, 0.45F},
                                              {0.48F, 0.24F, 0.22F},
                                              {0.36F, 0.30F, 0.26F},
                                              {0.55F, 0.55F, 0.52F},
                                              {0.66F, 0.58F, 0.42F}}};
  return colours;
}

Colour Varied(const Colour& colour, CampusRandom& random) {
  const float light = random.Uniform(0.92F, 1.04F);
  return (colour * light).min(1.0F);
}

void UsePlaster(const CampusMaterials& m, CampusRandom& random, Scene& scene, HouseStyle& style) {
  style.wall = AddTintedMaterial(
      "plaster", m.plaster_texture, Varied(random.Pick(PlasterColours()), random), scene);
  style.wall_tile = kTilePlaster;
  style.windows.has_moulding = random.Chance(0.45);
}

void UseBricks(const CampusMaterials& m, CampusRandom& random, HouseStyle& style) {
  style.wall = random.Pick(m.bricks);
  style.wall_tile = kTileBrick;
}

void UseBoards(const CampusMaterials& m, CampusRandom& random, Scene& scene, HouseStyle& style) {
  style.wall = AddTintedMaterial(
      "clapboard", m.clapboard_texture, Varied(random.Pick(BoardColours()), random), scene);
  style.wall_tile = kTileBoards;
}

void DrawWindows(const CampusMaterials& m, CampusRandom& random, Scene& scene, HouseStyle& style) {
  style.windows.frame =
      random.Chance(0.7)
          ? m.white_wood
          : AddTintedMaterial("window frame", m.plank_texture, random.Pick(PaintColours()), scene);
  style.windows.surround = random.Chance(0.6) ? m.stone : m.white_wood;
  style.windows.shutter =
      AddTintedMaterial("shutter", m.plank_texture, random.Pick(PaintColours()), scene);
  style.windows.panes_across = 1 + static_cast<int>(random.Index(2));
  style.windows.panes_up = 1 + static_cast<int>(random.Index(3));
  style.window_width = random.Uniform(0.95F, 1.3F);
  style.window_height = random.Uniform(1.3F, 1.65F);
  style.bay = random.Uniform(2.1F, 2.8F);
}

void DrawShop(const CampusMaterials& m, CampusRandom& random, Scene& scene, HouseStyle& style) {
  style.ground_floor = GroundFloor::kShop;
  style.width = random.Uniform(7.0F, 11.5F);
  style.depth = 10.0F;
  style.storeys = 2 + static_cast<int>(random.Index(3));
  style.storey_height = random.Uniform(2.95F, 3.3F);
  style.plinth = 0.16F;
  style.is_attached = true;
  style.has_bands = random.Chance(0.7);
  style.roof = random.Chance(0.35) ? RoofShape::kFlat : RoofShape::kGable;
  style.has_dormers = style.roof == RoofShape::kGable && random.Chance(0.5);
  style.roof_pitch = random.Uniform(0.6F, 0.95F);
  if (random.Chance(0.6))
    UsePlaster(m, random, scene, style);
  else
    UseBricks(m, random, style);
  style.ground_wall =
      AddTintedMaterial("shop front", m.plaster_texture, random.Pick(PaintColours()), scene);
  style.windows.has_shutters = random.Chance(0.25);
}

void DrawApartments(const CampusMaterials& m,
                    CampusRandom& random,
                    Scene& scene,
                    HouseStyle& style) {
  style.width = random.Uniform(15.0F, 20.0F);
  style.depth = 11.0F;
  style.storeys = 3 + static_cast<int>(random.Index(2));
  style.storey_height = 2.85F;
  style.plinth = 0.5F;
  style.roof = random.Chance(0.6) ? RoofShape::kFlat : RoofShape::kHip;
  style.roof_pitch = 0.45F;
  style.has_balconies = true;
  style.bay = random.Uniform(2.8F, 3.4F);
  style.window_width = 1.5F;
  style.has_chimney = false;
  style.has_cornice = style.roof == RoofShape::kHip;
  if (random.Chance(0.6))
    UsePlaster(m, random, scene, style);
  else
    UseBricks(m, random, style);
  style.windows.has_moulding = false;
  style.ground_wall = random.Chance(0.5) ? m.concrete : style.wall;
}

void DrawVilla(const CampusMaterials& m, CampusRandom& random, Scene& scene, HouseStyle& style) {
  style.width = random.Uniform(8.5F, 12.0F);
  style.depth = random.Uniform(8.5F, 10.0F);
  style.storeys = 2;
  style.plinth = random.Uniform(0.3F, 0.65F);
  style.roof =
      std::array{RoofShape::kHip, RoofShape::kGable, RoofShape::kCrossGable}.at(random.Index(3));
  style.roof_pitch = random.Uniform(0.5F, 0.85F);
  if (random.Chance(0.5))
    UseBricks(m, random, style);
  else
    UsePlaster(m, random, scene, style);
  style.ground_wall = random.Chance(0.25) ? m.stone : style.wall;
  style.windows.has_shutters = random.Chance(0.35);
  style.has_porch = random.Chance(0.5);
}

void DrawCottage(const CampusMaterials& m, CampusRandom& random, Scene& scene, HouseStyle& style) {
  style.width = random.Uniform(7.5F, 10.5F);
  style.depth = random.Uniform(7.5F, 9.5F);
  style.storeys = 1 + static_cast<int>(random.Index(2));
  style.plinth = random.Uniform(0.25F, 0.6F);
  style.roof = random.Chance(0.5) ? RoofShape::kGable : RoofShape::kCrossGable;
  style.roof_pitch = random.Uniform(0.7F, 1.0F);
  style.has_dormers = style.roof == RoofShape::kGable && random.Chance(0.5);
  if (random.Chance(0.75))
    UseBoards(m, random, scene, style);
  else
    UsePlaster(m, random, scene, style);
  style.ground_wall = style.wall;
  style.has_porch = random.Chance(0.7);
  style.has_cornice = false;
  style.windows.has_shutters = random.Chance(0.4);
}

void DrawTerrace(const CampusMaterials& m, CampusRandom& random, HouseStyle& style) {
  style.width = random.Uniform(5.4F, 6.2F);
  style.depth = 9.0F;
  style.storeys = 2;
  style.plinth = 0.3F;
  style.is_attached = true;
  style.roof_pitch = 0.7F;
  UseBricks(m, random, style);
  style.ground_wall = style.wall;
  style.windows.frame = m.white_wood;
  style.windows.surround = m.stone;
  style.bay = 2.6F;
}

void DrawCampusBuilding(const CampusMaterials& m,
                        CampusRandom& random,
                        Scene& scene,
                        HouseStyle& style) {
  style.ground_floor = GroundFloor::kEntrance;
  style.width = 40.0F;
  style.depth = 15.0F;
  style.storeys = 3 + static_cast<int>(random.Index(2));
  style.storey_height = 3.5F;
  style.plinth = 0.34F;
  style.roof = RoofShape::kFlat;
  style.wall = random.Chance(0.6)
                   ? m.concrete
                   : AddTintedMaterial("cladding", m.plaster_texture, {0.78F, 0.79F, 0.80F}, scene);
  style.wall_tile = kTileConcrete;
  style.ground_wall =
      AddTintedMaterial("dark cladding", m.metal_texture, {0.42F, 0.44F, 0.46F}, scene);
  style.windows.frame = m.dark_metal;
  style.windows.surround = m.metal;
  style.windows.panes_across = 3;
  style.windows.panes_up = 2;
  style.windows.reveal = 0.2F;
  style.window_width = 2.7F;
  style.window_height = 1.9F;
  style.bay = 3.3F;
  style.has_bands = true;
  style.has_chimney = false;
  style.has_cornice = false;
  style.sign = random.Index(12);
}

void DrawGarages(const CampusMaterials& m, CampusRandom& random, Scene& scene, HouseStyle& style) {
  style.ground_floor = GroundFloor::kGarages;
  style.width = 18.6F;
  style.depth = 6.0F;
  style.storeys = 1;
  style.storey_height = 2.6F;
  style.plinth = 0.06F;
  style.roof = RoofShape::kFlat;
  UsePlaster(m, random, scene, style);
  style.ground_wall = style.wall;
  style.has_chimney = false;
  style.has_cornice = false;
}

}  // namespace

HouseStyle DrawHouseStyle(HouseKind kind,
                          const CampusMaterials& materials,
                          CampusRandom& random,
                          Scene& scene) {
  HouseStyle style;
  style.roof_material = random.Pick(materials.roofs);
  style.plinth_material = random.Chance(0.5) ? materials.stone : materials.concrete;
  style.sign = random.Index(12);
  style.door_part = random.Unit();
  DrawWindows(materials, random, scene, style);
  switch (kind) {
    case HouseKind::kShop:
      DrawShop(materials, random, scene, style);
      break;
    case HouseKind::kTerrace:
      DrawTerrace(materials, random, style);
      break;
    case HouseKind::kVilla:
      DrawVilla(materials, random, scene, style);
      break;
    case HouseKind::kCottage:
      DrawCottage(materials, random, scene, style);
      break;
    case HouseKind::kApartments:
      DrawApartments(materials, random, scene, style);
      break;
    case HouseKind::kCampus:
      DrawCampusBuilding(materials, random, scene, style);
      break;
    case HouseKind::kGarages:
      DrawGarages(materials, random, scene, style);
  }
  return style;
}

}  // namespace relocd
