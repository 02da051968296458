#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "smoothing/fix.h"
#include "smoothing/fixed_lag_smoother.h"
#include "smoothing/offline_smoother.h"
#include "smoothing/smoother_config.h"

namespace relocd {

/// Reads `time_ns,dx_m,dy_m,dtheta_rad[,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt]`: the motion
/// since the row before, in the body frame there, and its right perturbation's covariance; without
/// one, the config's default noise.
///
/// @return kInvalidInput with file, line and what is allowed: another header, a number that is none
/// or not finite, times that do not increase, a covariance that is none.
Result<std::vector<OdometryStep>> ParseOdometryCsv(std::string_view text,
                                                   const std::string& path,
                                                   const SmootherConfig& config);

/// Reads `time_ns,x_m,y_m[,heading_rad[,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt]]`. An empty
/// heading means position only: its covariance is cov_xx, cov_xy and cov_yy along the map's axes,
/// else the pose's is of the right perturbation. Without one, the config's default sigmas.
///
/// @return kInvalidInput as for the odometry.
Result<std::vector<Fix>> ParseFixesCsv(std::string_view text,
                                       const std::string& path,
                                       const SmootherConfig& config);

/// Reads both from files. @return also kUnavailable when one cannot be read.
Result<MotionLog> ReadMotionLog(const std::string& odometry_path,
                                const std::string& fixes_path,
                                const SmootherConfig& config);

/// `time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,status`, the covariance
/// of the right perturbation; the cells of a row without pose, or with a position alone, are empty.
std::string FormatEstimatesCsv(const std::vector<SmootherEstimate>& estimates);

}  // namespace relocd
