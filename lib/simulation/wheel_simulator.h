#pragma once

#include <vector>

#include "can/candump_log.h"
#include "can/dbc.h"
#include "core/result.h"
#include "geometry/trajectory.h"
#include "odometry/wheel_odometry.h"
#include "simulation/wheel_motion.h"
#include "simulation/wheel_sensors.h"

namespace relocd {

/// The CAN frames of a drive, as the vehicle's config and DBC file describe them. The same seed
/// gives the same frames.
///
/// @param motions  what the wheels truly do, every period of the options.
/// @return kInvalidInput when an option is out of range, or the signals cannot hold what the wheels
///         do.
Result<std::vector<CandumpRecord>> SimulateWheelFrames(const std::vector<WheelMotion>& motions,
                                                       const OdometryConfig& vehicle,
                                                       const DbcFile& dbc,
                                                       const WheelSimulationOptions& options);

struct SimulatedDrive {
  std::vector<CandumpRecord> frames;
  Trajectory2 X_WBs;  ///< The truth at the times of the frames.
};

/// The same for a drive along a trajectory of the body.
///
/// The trajectory is interpolated smoothly. What it moves sideways, wheels do not see.
///
/// @param X_WBs  at least two poses.
/// @return kInvalidInput also when the trajectory is too short.
Result<SimulatedDrive> SimulateWheels(const Trajectory2& X_WBs,
                                      const OdometryConfig& vehicle,
                                      const DbcFile& dbc,
                                      const WheelSimulationOptions& options);

}  // namespace relocd
