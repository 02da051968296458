#pragma once

#include <set>
#include <string>
#include <vector>

#include "calibration/drive_filter.h"
#include "calibration/odometry_recording.h"
#include "core/result.h"
#include "odometry/wheel_odometry.h"

namespace relocd {

/// One number that a calibration looks for.
struct CalibratedParameter {
  std::string name;
  double before = 0.0;
  double expected_sigma = 0.0;  ///< Of what was known before.
  double after = 0.0;
  double sigma = 0.0;
  /// Whether the drive told it. If not it stays as it was, and `sigma` is what the drive left of
  /// expected_sigma.
  bool is_known = false;
};

struct OdometryCalibrationOptions {
  DriveParameters initial{};    ///< Of the mounting and the time offset; the rest is the config's.
  std::set<std::string> fixed;  ///< Names of parameters that are not looked for.
  double spacing_s = 0.5;       ///< Between two poses of the reference that are used.
};

/// What a drive tells of a vehicle.
struct OdometryCalibration {
  std::vector<CalibratedParameter> parameters;
  DriveParameters drive;
  DriveNoise noise;
  // Whether there is more of a noise than the reference's hides, and the drive shows it.
  bool has_wheel_noise = false;
  bool has_turn_noise = false;
  bool has_lateral_noise = false;
  bool has_yaw_rate_noise = false;
  bool has_steering_noise = false;
  int references = 0;
  int outliers = 0;
  double residual_rms = 0.0;  ///< Of the whitened innovations: 1 if the noise is right.
};

/// Finds the parameters of a vehicle's odometry under which its recorded drive fits a reference
/// best: wheels first, then the yaw-rate sensor, then the steering, as far as they were recorded.
/// The noise of each is found with them, by maximum likelihood.
///
/// References that are off by much more than the others count less.
///
/// @return kInvalidInput when reference and recording share too little of their time, or the
///         reference does not move.
Result<OdometryCalibration> CalibrateOdometry(const OdometryRecording& recording,
                                              const std::vector<ReferencePose>& references,
                                              const OdometryConfig& config,
                                              const OdometryCalibrationOptions& options);

/// Where the body was by a reference and the calibrated recording together, `spacing_s` apart.
///
/// What odometry is to be judged by: the reference itself may have single poses that are far off,
/// no headings, or noise that makes its way longer than the body's.
std::vector<ReferencePose> SmoothReference(const OdometryRecording& recording,
                                           const std::vector<ReferencePose>& references,
                                           const OdometryCalibration& calibration,
                                           double spacing_s);

/// The config with what was found in it.
OdometryConfig ApplyCalibration(const OdometryConfig& config,
                                const OdometryCalibration& calibration);

/// The names of all parameters that may be fixed.
std::vector<std::string> CalibrationParameterNames();

}  // namespace relocd
