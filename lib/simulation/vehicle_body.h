#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "core/result.h"
#include "geometry/pose3.h"
#include "simulation/drive_plan.h"
#include "simulation/world.h"

namespace relocd {

/// Where a vehicle's four wheels stand.
struct VehicleGeometry {
  double track_m = 1.5;
  double wheelbase_m = 2.7;

  /// Of rear left, rear right, front left, front right, in B.
  [[nodiscard]] std::array<Eigen::Vector2d, 4> WheelsInBody() const;
};

/// How a vehicle's body moves on its springs.
struct VehicleBodyOptions {
  std::uint64_t seed = 0;             ///< Of the ground's roughness.
  double roughness = 1.0;             ///< 1: pitch and roll of 0.4 deg rms; 0: none.
  double pitch_rad_per_mps2 = 0.006;  ///< The nose rises when it accelerates.
  double roll_rad_per_mps2 = 0.006;   ///< It leans out of bends.

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// The pose in space of a vehicle that drives over the ground: it lies as its wheels do, pitches
/// and rolls with acceleration and with the ground's roughness.
///
/// That is more than odometry and smoothing know, which take the body to be planar and the camera
/// to be fixed to it. Seen from above B is where the plan has it, and so is its heading.
///
/// Borrows plan and ground, which must outlive it. Thread-safe.
class VehicleBody {
 public:
  VehicleBody(const DrivePlan& plan,
              const Ground& ground,
              const VehicleGeometry& geometry,
              const VehicleBodyOptions& options);

  /// At a time since the begin.
  [[nodiscard]] Pose3 At(std::int64_t time_ns) const;

 private:
  /// A part of the roughness that repeats along the way.
  struct Bump {
    double radians_per_m = 1.0;
    std::array<double, 3> phases_rad{};
  };
  static constexpr std::size_t kBumps = 24;

  /// Pitch, roll and height, each of rms 1, at a distance along the way.
  [[nodiscard]] Eigen::Vector3d RoughnessAt(double travel_m) const;

  const DrivePlan& plan_;
  const Ground& ground_;
  VehicleGeometry geometry_;
  VehicleBodyOptions options_;
  std::array<Bump, kBumps> bumps_;
};

}  // namespace relocd
