#pragma once

#include <string>

#include "calibration/drive_judgement.h"
#include "calibration/odometry_calibration.h"
#include "calibration/umbmark.h"
#include "core/result.h"
#include "odometry/wheel_odometry.h"

namespace relocd {

/// Each parameter before and after with its standard deviation, and the noise that was found.
std::string FormatParameters(const OdometryCalibration& calibration);

/// Errors of odometry alone before and after.
std::string FormatJudgement(const DriveJudgement& before, const DriveJudgement& after);

/// The lines of a config that differ, to be pasted into it.
std::string FormatConfigLines(const OdometryConfig& before, const OdometryConfig& after);

/// What ten square runs tell, and the config's lines.
std::string FormatUmbmark(const Umbmark& umbmark, const OdometryConfig& config);

/// Odometry before and after, and the reference, seen from above, as a PNG.
///
/// @return kUnavailable when the file cannot be written.
Result<void> PlotCalibration(const DriveJudgement& before,
                             const DriveJudgement& after,
                             const std::string& path);

}  // namespace relocd
