#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "rendering/scene.h"
#include "simulation/campus_materials.h"
#include "simulation/campus_pictures.h"
#include "simulation/campus_random.h"

namespace relocd {

/// Where the light of a street lamp is in the frame of its post, m.
inline const Eigen::Vector3f kLampHead{1.15F, 0.0F, 5.05F};

/// Meshes of things in the street. They stand on the origin and face x; what has a length runs
/// along x from the origin.
struct CampusFurniture {
  std::uint32_t lamp_post = 0;  ///< Its arm reaches along x.
  std::uint32_t bench = 0;
  std::uint32_t bin = 0;
  std::uint32_t bollard = 0;
  std::uint32_t letter_box = 0;
  std::uint32_t cabinet = 0;
  std::uint32_t planter = 0;
  std::uint32_t bicycle_stand = 0;
  std::uint32_t shelter = 0;
  std::uint32_t advertising_column = 0;
  std::uint32_t wire_pole = 0;
  std::array<std::uint32_t, 8> signs{};  ///< By TrafficSign.
  std::uint32_t picket_fence = 0;        ///< 2 m.
  std::uint32_t rail_fence = 0;          ///< 2 m, of metal.
  std::uint32_t board_fence = 0;         ///< 2 m, high.
  std::uint32_t low_wall = 0;            ///< 2 m.
};

CampusFurniture MakeCampusFurniture(const CampusMaterials& materials,
                                    CampusRandom random,
                                    Scene& scene);

}  // namespace relocd
