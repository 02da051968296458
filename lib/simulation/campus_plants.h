#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "rendering/scene.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_random.h"

namespace relocd {

enum class TreeKind { kLime, kBirch, kPlane, kSpruce, kYoung, kPoplar };

inline constexpr std::size_t kTreeKinds = 6;

/// Meshes of plants, to be placed upright with their root at the origin.
struct CampusPlants {
  std::array<std::vector<std::uint32_t>, kTreeKinds> trees;  ///< Of each kind some.
  std::vector<std::uint32_t> bushes;
  std::uint32_t hedge = 0;  ///< 2 m along x from the origin, in the middle of its width.
  std::uint32_t low_hedge = 0;
  std::vector<std::uint32_t> tufts;  ///< Of grass, over some square metres.

  [[nodiscard]] const std::vector<std::uint32_t>& Trees(TreeKind kind) const {
    return trees.at(static_cast<std::size_t>(kind));
  }
};

CampusPlants MakeCampusPlants(const CampusMaterials& materials, CampusRandom random, Scene& scene);

}  // namespace relocd
