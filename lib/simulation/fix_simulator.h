#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "geometry/pose2.h"
#include "geometry/trajectory.h"

namespace relocd {

/// How the poses that a simulated camera finds in a map differ from the true ones.
struct FixSimulationOptions {
  std::uint64_t seed = 0;
  double rate_hz = 5.0;
  double sigma_m = 0.5;              ///< Of each coordinate, independent from fix to fix.
  double heading_sigma_rad = 0.0;    ///< 0: the fixes have no heading.
  double outlier_share = 0.0;        ///< So many are off by up to `outlier_reach_m` more.
  double outlier_reach_m = 50.0;     ///< In each direction alike, the heading anything.
  double bias_sigma_m = 0.0;         ///< Of an error of each coordinate that lasts.
  double bias_correlation_s = 10.0;  ///< After so long it is down to 1/e.
  double mounting_yaw_rad = 0.0;     ///< By which the camera looks to the left of what is believed.
  double time_offset_s = 0.0;        ///< By which the fixes' times are late.

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

struct SimulatedFix {
  std::int64_t time_ns = 0;
  Pose2 X_WB;
  bool is_outlier = false;
};

/// What such a camera finds along a trajectory. It knows of `sigma_m` and `heading_sigma_rad`, and
/// nothing of outliers and of what lasts. The same seed gives the same fixes.
///
/// @param X_WBs    at least one pose.
/// @return kInvalidInput when an option is out of range.
Result<std::vector<SimulatedFix>> SimulateFixes(const Trajectory2& X_WBs,
                                                const FixSimulationOptions& options);

}  // namespace relocd
