#pragma once

#include <cstdint>
#include <vector>

#include "calibration/drive_filter.h"
#include "core/result.h"
#include "geometry/trajectory.h"

namespace relocd {

/// How far odometry alone goes astray, put onto the reference at the begin.
struct DriveJudgement {
  double begin_s = 0.0;  ///< Of what was compared, on the reference's clock.
  double end_s = 0.0;
  double length_m = 0.0;           ///< Of the reference.
  double distance_error = 0.0;     ///< Of odometry's length, as part of the reference's.
  double heading_error_rad = 0.0;  ///< At the end.
  double worst_heading_error_rad = 0.0;
  double position_error_m = 0.0;  ///< At the end.
  double worst_position_error_m = 0.0;
  std::vector<Eigen::Vector2d> reference_m;  ///< The body's way, to draw.
  std::vector<Eigen::Vector2d> odometry_m;
};

/// @param X_OBs          odometry.
/// @param origin_ns      what the bodies' times count from.
/// @param bodies         where the body was, as SmoothReference gives it.
/// @param time_offset_s  odometry's time less that of the bodies.
/// @return kInvalidInput when fewer than two bodies lie within odometry's time.
Result<DriveJudgement> JudgeOdometry(const Trajectory2& X_OBs,
                                     std::int64_t origin_ns,
                                     const std::vector<ReferencePose>& bodies,
                                     double time_offset_s);

}  // namespace relocd
