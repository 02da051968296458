#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "can/candump_log.h"
#include "can/dbc.h"
#include "core/result.h"
#include "geometry/trajectory.h"
#include "odometry/wheel_odometry.h"

namespace relocd {

/// How the simulated wheels differ from perfect ones.
struct WheelSimulationOptions {
  std::uint64_t seed = 0;
  double rate_hz = 100.0;
  std::string interface = "can0";  ///< Of the frames.
  /// Each wheel's radius is off by a part drawn once, with this standard deviation.
  double radius_sigma = 0.0;
  /// White noise of each wheel's travel after one metre. Negative: as odometry's config has it.
  double wheel_sigma_m_per_sqrt_m = -1.0;
  double slips_per_m = 0.0;    ///< Mean number of slips of each wheel.
  double slip_sigma_m = 0.02;  ///< How far a wheel turns in vain in one.
};

struct SimulatedDrive {
  std::vector<CandumpRecord> frames;
  Trajectory2 X_WBs;  ///< The truth at the times of the frames.
};

/// The wheels' CAN frames of a drive along a trajectory of the body, as the vehicle's config and
/// DBC file describe them: ticks that wrap or speeds, with frame counter and checksum.
///
/// The trajectory is interpolated smoothly. What it moves sideways, wheels do not see. The same
/// seed gives the same frames.
///
/// @param X_WBs  at least two poses.
/// @return kInvalidInput when the trajectory is too short, an option is out of range, or the
///         signals cannot hold what the wheels do.
Result<SimulatedDrive> SimulateWheels(const Trajectory2& X_WBs,
                                      const OdometryConfig& vehicle,
                                      const DbcFile& dbc,
                                      const WheelSimulationOptions& options);

/// Poses along a trajectory, with a velocity that does not jump: cubic Hermite splines of position
/// and unwrapped heading through the trajectory's poses.
class SmoothTrajectory {
 public:
  /// @param X_WBs  at least two, of strictly increasing times.
  explicit SmoothTrajectory(const Trajectory2& X_WBs);

  [[nodiscard]] std::int64_t begin_ns() const { return knots_.front().time_ns; }
  [[nodiscard]] std::int64_t end_ns() const { return knots_.back().time_ns; }

  /// The pose at a time, which is clamped to the trajectory's.
  [[nodiscard]] Pose2 At(std::int64_t time_ns) const;

 private:
  struct Knot {
    std::int64_t time_ns = 0;
    Eigen::Vector3d value = Eigen::Vector3d::Zero();  ///< x, y, unwrapped heading.
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();   ///< Per second.
  };

  std::vector<Knot> knots_;
};

}  // namespace relocd
