#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "camera/camera_config.h"
#include "camera/v4l2_system.h"

namespace relocd {

/// What became of the controls that the config asks for, as the driver says it when it is asked.
struct V4l2ControlsReport {
  std::vector<std::string> given;      ///< As asked: `gain 20`.
  std::vector<std::string> otherwise;  ///< `gain is 255, asked for 300, allowed [0, 255]`.
  std::int32_t exposure_us = -1;       ///< Of a camera with a fixed exposure; else -1.
};

/// Sets an open device's controls, and reads each back. A value outside the driver's range becomes
/// the nearest one that it allows. What it lacks or refuses is reported, and hinders nothing: an
/// image in other light is better than none.
///
/// @param fourcc  the agreed pixel format: only a camera that makes JPEGs has their quality.
V4l2ControlsReport ApplyControls(V4l2System& system,
                                 int fd,
                                 const CameraConfig& config,
                                 std::uint32_t fourcc);

/// The controls that an open device has, each with its range: `gain [0, 255]`.
std::vector<std::string> ListControls(V4l2System& system, int fd);

/// A control's name as v4l2-ctl writes it: `white_balance_automatic` for "White Balance,
/// Automatic".
std::string ControlKey(std::string_view name);

}  // namespace relocd
