#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rendering/scene.h"
#include "simulation/campus_ground.h"
#include "simulation/campus_lines.h"
#include "simulation/campus_roads.h"

namespace relocd {

/// A rectangle on the ground that something takes.
struct SiteRectangle {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  Eigen::Vector2d along = Eigen::Vector2d::UnitX();  ///< Unit vector.
  Eigen::Vector2d half_size = Eigen::Vector2d::Zero();

  [[nodiscard]] Eigen::Vector2d across() const { return {-along.y(), along.x()}; }
  [[nodiscard]] Eigen::Vector2d Corner(double u, double v) const {
    return centre + u * half_size.x() * along + v * half_size.y() * across();
  }
};

bool AreOverlapping(const SiteRectangle& a, const SiteRectangle& b);

/// Beside a street: where, and which way the street is.
struct KerbPlace {
  Eigen::Vector2d p_W = Eigen::Vector2d::Zero();
  Eigen::Vector2d to_road = Eigen::Vector2d::UnitX();
  Eigen::Vector2d along = Eigen::Vector2d::UnitY();  ///< In the direction of the street's line.
};

/// Puts meshes of a scene onto the ground, and knows which ground is taken. Borrows all that it is
/// made of.
class CampusSite {
 public:
  CampusSite(const CampusGround& ground, const RoadNetwork& network, Scene& scene)
      : ground_(ground), network_(network), scene_(scene) {}

  [[nodiscard]] const CampusGround& ground() const { return ground_; }
  [[nodiscard]] const RoadNetwork& network() const { return network_; }
  [[nodiscard]] const RoadField& field() const { return ground_.roads(); }
  [[nodiscard]] Scene& scene() { return scene_; }

  /// @param forward  where the mesh's x goes.
  void Place(std::uint32_t mesh,
             const Eigen::Vector2d& p_W,
             const Eigen::Vector2d& forward,
             double above_m = 0.0,
             float scale = 1.0F);

  /// `gap_m` outside of the kerb at `distance_m` along a street, beyond any bay there; nothing
  /// where a side street is.
  [[nodiscard]] std::optional<KerbPlace> BesideStreet(const PlaneLine& street,
                                                      StreetSide side,
                                                      double distance_m,
                                                      double gap_m) const;

  /// Whether nothing is there yet, nor a road or sidewalk closer than `to_road_m`.
  [[nodiscard]] bool IsFree(const SiteRectangle& rectangle, double to_road_m) const;
  [[nodiscard]] bool IsFree(const Eigen::Vector2d& p_W, double radius_m, double to_road_m) const;

  void Take(const SiteRectangle& rectangle) { taken_.push_back(rectangle); }

  /// Segments of 2 m that follow the ground from one point to the other; the last one is shortened.
  void PlaceFence(std::uint32_t mesh, const Eigen::Vector2d& from, const Eigen::Vector2d& to);

 private:
  const CampusGround& ground_;
  const RoadNetwork& network_;
  Scene& scene_;
  std::vector<SiteRectangle> taken_;
};

}  // namespace relocd
