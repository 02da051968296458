#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "geometry/pose2.h"
#include "rendering/scene.h"

namespace relocd {

/// The surface that wheels roll on. Immutable, hence thread-safe.
class Ground {
 public:
  Ground() = default;
  virtual ~Ground() = default;
  Ground(const Ground&) = delete;
  Ground& operator=(const Ground&) = delete;
  Ground(Ground&&) = delete;
  Ground& operator=(Ground&&) = delete;

  /// z in W, m, below or above any point of the plane.
  [[nodiscard]] virtual double HeightAt(const Eigen::Vector2d& p_W) const = 0;

  /// The same below something that heads so, forwards or backwards: where a road crosses itself,
  /// its direction tells the bridge from what runs below it.
  [[nodiscard]] virtual double HeightAlong(const Eigen::Vector2d& p_W,
                                           double /*heading_rad*/) const {
    return HeightAt(p_W);
  }
};

/// A line in the plane to drive or walk along, in its order. Points are 0.2 m to 5 m apart, without
/// corners sharper than a vehicle can turn.
struct Path {
  std::vector<Eigen::Vector2d> points;  ///< In W, m.
  bool is_closed = false;               ///< The last point is followed by the first.
};

/// Where a car may be parked: the middle of it on the ground, x along it.
using ParkingSpot = Pose2;

/// A place to drive in: what stands there in every session, and where things may move.
///
/// W is z up, in metres.
struct World {
  std::string name;
  Scene scene;  ///< Without cars and people. Its materials include those of `car_meshes` etc.
  std::shared_ptr<const Ground> ground;
  Path route;                 ///< The vehicle's B along the right-hand lane.
  std::vector<Path> traffic;  ///< The middle of lanes for other cars, in their direction.
  std::vector<Path> walkways;
  std::vector<ParkingSpot> parking_spots;
  /// Meshes of the scene, not among its instances, that sessions place: x forward, z up, the origin
  /// on the ground in the middle. Empty where a world has none.
  std::vector<std::uint32_t> car_meshes;
  std::vector<std::uint32_t> pedestrian_meshes;
};

/// All that MakeWorld knows by name on this machine.
std::vector<std::string> WorldNames();

/// A world by name: `campus`, or `torcs:TRACK` (as in torcs:aalborg) of Debian's torcs-data, or
/// `torcs:FOLDER` with a slash, a folder that has a track.
///
/// @param seed  of procedural worlds; the others are what they are.
/// @return kInvalidInput for an unknown name (which lists the known ones) or a damaged file;
///         kUnavailable for a file that cannot be read.
Result<World> MakeWorld(const std::string& name, std::uint64_t seed);

}  // namespace relocd
