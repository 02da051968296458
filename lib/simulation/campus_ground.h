#pragma once

#include <array>
#include <memory>

#include <Eigen/Core>

#include "simulation/campus_random.h"
#include "simulation/campus_road_field.h"
#include "simulation/world.h"

namespace relocd {

/// How high kerbs are above the road, m. All that is not road is as high.
inline constexpr double kCampusKerbHeight = 0.12;

/// The rolling ground of the campus before kerbs are put on it: long waves whose slopes add up to
/// at most 2.9 %. Immutable, hence thread-safe.
class CampusTerrain {
 public:
  explicit CampusTerrain(CampusRandom random);

  /// z in W of the road's surface, m.
  [[nodiscard]] double HeightAt(const Eigen::Vector2d& p_W) const;

 private:
  struct Wave {
    Eigen::Vector2d wave_number = Eigen::Vector2d::Zero();
    double phase = 0.0;
    double amplitude = 0.0;
  };

  std::array<Wave, 4> waves_;
};

/// The terrain, and a kerb's height more beside the road. Immutable, hence thread-safe.
class CampusGround final : public Ground {
 public:
  CampusGround(const CampusTerrain& terrain, RoadField roads);

  [[nodiscard]] double HeightAt(const Eigen::Vector2d& p_W) const override;

  [[nodiscard]] const CampusTerrain& terrain() const { return terrain_; }
  [[nodiscard]] const RoadField& roads() const { return roads_; }

  /// The point on the surface at `p_W`, `above_m` above it.
  [[nodiscard]] Eigen::Vector3f PointAt(const Eigen::Vector2d& p_W, double above_m = 0.0) const;

 private:
  CampusTerrain terrain_;
  RoadField roads_;
};

}  // namespace relocd
