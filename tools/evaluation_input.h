#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "geometry/pose3.h"

namespace relocd {

/// One row of a trajectory that is compared.
struct EvaluatedPose {
  std::int64_t time_ns = 0;
  Pose3 X_WB;  ///< Of a planar file on the plane z = 0; with yaw 0 if it has no heading.
  bool has_heading = true;
  /// 3x3 of the right perturbation (x, y, yaw), in m and rad; only its upper left 2x2 without a
  /// heading.
  std::optional<Eigen::Matrix3d> covariance;
};

/// What a file says of a moving body, or camera.
struct EvaluatedTrajectory {
  std::string path;
  bool planar = false;
  std::size_t rows = 0;
  std::vector<EvaluatedPose> poses;  ///< Of the rows that have one; times increase.
  std::map<std::string, std::size_t> rows_without_pose;  ///< By status.
};

/// Reads one of these, told apart by the first line that is no comment:
///   TUM: `time_s tx ty tz qx qy qz qw`;
///   in the plane: `time_ns` or `time_s` or `t_s`, `x_m`, `y_m`, and if there `heading_rad` or
///     `theta_rad`, `cov_xx`,...,`cov_tt`, `status`;
///   in space: `time_ns` or `time_s`, `tx_m`, `ty_m`, `tz_m`, `qw`, `qx`, `qy`, `qz`, and if there
///     `status`.
/// In CSV, a row with an empty position has no pose.
///
/// @param rows  `A:B` of the rows behind the header; empty for all.
/// @return kInvalidInput with file, line, value and what is allowed; kUnavailable when the file
/// cannot be read.
Result<EvaluatedTrajectory> ReadEvaluatedTrajectory(const std::string& path,
                                                    std::string_view rows = {});
Result<EvaluatedTrajectory> ParseEvaluatedTrajectory(std::string_view text,
                                                     const std::string& path,
                                                     std::string_view rows = {});

}  // namespace relocd
