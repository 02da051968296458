#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/pose2.h"
#include "geometry/trajectory.h"
#include "simulation/drive_plan.h"
#include "simulation/vehicle_body.h"
#include "simulation/world.h"

namespace relocd {

/// Rear left, rear right, front left, front right: the order of all arrays of wheels.
inline constexpr std::size_t kWheels = 4;

/// What a vehicle's wheels truly do at one time.
struct WheelMotion {
  std::int64_t time_ns = 0;
  Pose2 X_WB{};
  std::array<double, kWheels> travel_m{};  ///< Since the begin, backwards negative.
  /// The mean over the period around this time, as sensors that count have it.
  std::array<double, kWheels> speeds_mps{};
  double steering_rad = 0.0;  ///< Of a front wheel in the middle, positive to the left.
  double yaw_rate_radps = 0.0;
  double acceleration_mps2 = 0.0;          ///< Forward.
  double lateral_acceleration_mps2 = 0.0;  ///< To the left.
};

/// The wheels along a planned drive, every `period_ns` from its begin. They roll over the ground,
/// so that they travel further up and down a slope than it is as seen from above.
std::vector<WheelMotion> RollWheels(const DrivePlan& plan,
                                    const Ground& ground,
                                    const VehicleGeometry& geometry,
                                    std::int64_t period_ns);

/// The wheels along any trajectory in the plane, interpolated smoothly, every `period_ns` from the
/// first whole microsecond. What it moves sideways, wheels do not see.
///
/// @param X_WBs  at least two, of strictly increasing times.
std::vector<WheelMotion> RollWheels(const Trajectory2& X_WBs,
                                    const VehicleGeometry& geometry,
                                    std::int64_t period_ns);

}  // namespace relocd
