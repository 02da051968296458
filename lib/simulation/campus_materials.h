#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rendering/scene.h"
#include "simulation/campus_random.h"

namespace relocd {

/// The campus' materials, as indices into its scene's.
struct CampusMaterials {
  // Ground.
  std::uint32_t asphalt = 0;
  std::uint32_t asphalt_old = 0;
  std::uint32_t asphalt_new = 0;
  std::uint32_t tar = 0;
  std::uint32_t paving = 0;
  std::uint32_t setts = 0;
  std::uint32_t gutter = 0;
  std::uint32_t kerb = 0;
  std::uint32_t grass = 0;
  std::uint32_t meadow = 0;
  std::uint32_t gravel = 0;
  std::uint32_t soil = 0;
  std::uint32_t hills = 0;
  std::uint32_t road_paint = 0;
  std::uint32_t road_details = 0;
  std::uint32_t cracks = 0;

  // Buildings.
  std::array<std::uint32_t, 3> bricks{};
  std::uint32_t concrete = 0;
  std::uint32_t stone = 0;
  std::array<std::uint32_t, 3> roofs{};
  std::uint32_t flat_roof = 0;
  std::uint32_t window = 0;
  std::uint32_t lit_window = 0;
  std::uint32_t shop_window = 0;
  std::uint32_t shop_sign = 0;
  std::uint32_t posters = 0;
  std::uint32_t doors = 0;
  std::uint32_t stains = 0;
  std::uint32_t ivy = 0;
  std::uint32_t white_wood = 0;
  std::uint32_t dark_wood = 0;
  std::uint32_t fence_wood = 0;

  // Things.
  std::uint32_t metal = 0;
  std::uint32_t dark_metal = 0;
  std::uint32_t rusty_metal = 0;
  std::uint32_t plates = 0;
  std::uint32_t lamp_glow = 0;
  std::uint32_t bark = 0;
  std::array<std::uint32_t, 4> leaves{};
  std::uint32_t hedge = 0;
  std::uint32_t grass_tuft = 0;

  // Cars.
  std::uint32_t car_glass = 0;
  std::uint32_t dark_plastic = 0;
  std::uint32_t rubber = 0;
  std::uint32_t head_light = 0;
  std::uint32_t tail_light = 0;
  std::uint32_t licence_plates = 0;

  // Textures from which others are tinted.
  int plaster_texture = -1;
  int clapboard_texture = -1;
  int metal_texture = -1;
  int plank_texture = -1;
};

/// Adds all textures and materials to the scene.
CampusMaterials MakeCampusMaterials(CampusRandom random, Scene& scene);

/// Adds a material of a texture and one colour (sRGB), such as one house's plaster.
std::uint32_t AddTintedMaterial(const std::string& name,
                                int texture,
                                const Eigen::Array3f& srgb,
                                Scene& scene);

}  // namespace relocd
