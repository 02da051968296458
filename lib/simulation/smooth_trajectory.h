#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "geometry/trajectory.h"

namespace relocd {

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
