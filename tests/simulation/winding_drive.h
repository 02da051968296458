#pragma once

#include <cmath>
#include <cstdint>

#include "geometry/trajectory.h"

namespace relocd {

inline constexpr std::int64_t kWindingStepNs = 50'000'000;

/// Half a minute of bends and changes of speed, sometimes backwards, without any sideways motion.
inline Trajectory2 WindingDrive() {
  Trajectory2 X_WBs;
  Pose2 X_WB(3.0, -2.0, 2.5);
  for (int i = 0; i < 600; ++i) {
    X_WBs.push_back({.time_ns = i * kWindingStepNs, .X_WB = X_WB});
    const double t = 0.05 * i;
    const double speed = 0.8 + 1.0 * std::sin(0.3 * t);
    const double yaw_rate = 0.6 * std::sin(0.17 * t) + 0.2 * std::cos(0.9 * t);
    X_WB = X_WB * Pose2::Exp(0.05 * Eigen::Vector3d(speed, 0.0, yaw_rate));
  }
  return X_WBs;
}

}  // namespace relocd
