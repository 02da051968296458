#pragma once

#include <vector>

#include <Eigen/Core>

#include "geometry/pose2.h"
#include "simulation/campus_lines.h"
#include "simulation/campus_random.h"
#include "simulation/campus_road_field.h"
#include "simulation/world.h"

namespace relocd {

/// From the middle of a street to its kerb, m.
inline constexpr double kStreetHalfWidth = 3.4;
/// From the middle of a street to the middle of a lane, m.
inline constexpr double kLaneOffset = 1.68;
/// How wide sidewalks are, with their kerb, m.
inline constexpr double kSidewalkWidth = 2.3;
/// How wide a bay for cars beside a street is, m.
inline constexpr double kBayWidth = 2.2;
/// The length of a parking spot in such a bay, m.
inline constexpr double kBaySpotLength = 6.2;
/// From the middle of a turning circle to its kerb, m.
inline constexpr double kTurningRadius = 9.2;

enum class StreetSide { kLeft, kRight };

/// A row of parking spots along one side of a street.
struct ParkingBay {
  std::size_t street = 0;
  StreetSide side = StreetSide::kLeft;
  double from_m = 0.0;  ///< Along the street's line.
  int spots = 0;
};

/// The streets by their middle lines, which meet like this (north is up; numbers in metres vary):
/// ```
///                        side_north
///      ring <----------------+--------------.
///             |   lot                        |
///           west          park              ring
///             |                              |
///      main --+------+-----------------------+---- main
///             |     spur
///           west   (turning circle)
/// ```
struct RoadNetwork {
  PlaneLine main;        ///< West to east.
  PlaneLine ring;        ///< From `main` north, then west beyond `west`.
  PlaneLine west;        ///< From `ring` south, across `main`.
  PlaneLine spur;        ///< From `main` south to the middle of the turning circle.
  PlaneLine side_north;  ///< From `ring` north.
  PlaneLine drive;       ///< From `ring` south into the parking lot.
  Eigen::Vector2d lot_low = Eigen::Vector2d::Zero();  ///< The lot's rectangle.
  Eigen::Vector2d lot_high = Eigen::Vector2d::Zero();
  std::vector<ParkingBay> bays;
  std::vector<Eigen::Vector2d> junctions;  ///< Where the route meets other streets.
  Path route;
  std::vector<Path> traffic;
  std::vector<ParkingSpot> parking_spots;

  /// Whether the ground beside the sidewalks is paved, as it is before shops, and no lawn.
  [[nodiscard]] bool IsPavedAt(const Eigen::Vector2d& p_W) const;

  /// All lines of streets, in the order in which `ParkingBay::street` counts.
  [[nodiscard]] std::vector<const PlaneLine*> Streets() const {
    return {&main, &ring, &west, &spur, &side_north, &drive};
  }
};

RoadNetwork MakeRoadNetwork(CampusRandom random);

/// The distances to all that belongs to the network.
RoadField MakeRoadField(const RoadNetwork& network);

}  // namespace relocd
