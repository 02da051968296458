#pragma once

#include <cstdint>

#include "rendering/scene.h"
#include "simulation/campus_facades.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_random.h"

namespace relocd {

enum class RoofShape { kGable, kCrossGable, kHip, kFlat };

enum class GroundFloor { kDwelling, kShop, kGarages, kEntrance };

/// What a building looks like. Its frame H: x along its front from its left corner, y into it, z up
/// from the ground before its door.
struct HouseStyle {
  float width = 9.0F;
  float depth = 9.0F;
  int storeys = 2;
  float storey_height = 2.9F;
  float plinth = 0.35F;  ///< The ground floor's height above the ground.
  RoofShape roof = RoofShape::kGable;
  float roof_pitch = 0.75F;  ///< Rise per run.
  GroundFloor ground_floor = GroundFloor::kDwelling;
  std::uint32_t wall = 0;
  float wall_tile = 3.84F;
  std::uint32_t ground_wall = 0;  ///< Of the ground floor.
  std::uint32_t roof_material = 0;
  std::uint32_t plinth_material = 0;
  WindowStyle windows;
  float window_width = 1.1F;
  float window_height = 1.45F;
  float bay = 2.4F;  ///< From window to window.
  bool has_balconies = false;
  bool has_bands = false;  ///< Between storeys.
  bool has_cornice = true;
  bool has_chimney = true;
  bool has_dormers = false;
  bool is_attached = false;  ///< To neighbours, with blind walls on that side.
  bool has_porch = false;
  std::size_t sign = 0;
  float door_part = 0.5F;  ///< Which of the ground floor's bays has the door, in [0, 1).
};

/// Where along its front the middle of a dwelling's door is, m.
float DoorCentre(const HouseStyle& style);

/// Kinds of houses, from which styles are drawn.
enum class HouseKind { kShop, kTerrace, kVilla, kCottage, kApartments, kCampus, kGarages };

/// Draws how a house of a kind looks; materials of its own are added to the scene.
HouseStyle DrawHouseStyle(HouseKind kind,
                          const CampusMaterials& materials,
                          CampusRandom& random,
                          Scene& scene);

Mesh MakeHouse(const HouseStyle& style, const CampusMaterials& materials, CampusRandom random);

}  // namespace relocd
