#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "geometry/pose2.h"
#include "geometry/pose3.h"

namespace relocd {

/// A pose and the time it holds for.
struct TimedPose3 {
  std::int64_t time_ns = 0;
  Pose3 X_WB;
};

/// A pose in the plane and the time it holds for.
struct TimedPose2 {
  std::int64_t time_ns = 0;
  Pose2 X_WB;
};

/// Poses of one moving frame with strictly increasing times.
using Trajectory3 = std::vector<TimedPose3>;
using Trajectory2 = std::vector<TimedPose2>;

/// Reads the TUM format: `time_s tx ty tz qx qy qz qw` a line, `#` starts a comment.
///
/// @return kInvalidInput with file and line for anything else, for a quaternion of no length, and
/// for times that do not
///         increase; kUnavailable when the file cannot be read.
Result<Trajectory3> ReadTumTrajectory(const std::string& path);
Result<Trajectory3> ParseTumTrajectory(std::string_view text, const std::string& path);
std::string FormatTumTrajectory(const Trajectory3& trajectory);

/// The pose at a time within the trajectory, interpolated along the screw between its neighbours;
/// nothing outside, or where the neighbours are more than `max_gap_ns` apart.
std::optional<Pose2> Interpolate(const Trajectory2& trajectory,
                                 std::int64_t time_ns,
                                 std::int64_t max_gap_ns);
std::optional<Pose3> Interpolate(const Trajectory3& trajectory,
                                 std::int64_t time_ns,
                                 std::int64_t max_gap_ns);

}  // namespace relocd
