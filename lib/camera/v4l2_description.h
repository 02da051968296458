#pragma once

#include <string>

#include "camera/camera_config.h"
#include "camera/v4l2_system.h"
#include "core/result.h"

namespace relocd {

/// What a camera offers, in one line: `MJPG 640 x 480 px at 30, 15 Hz; YUYV ...; controls: gain
/// [0, 255], ...`, of the size in the config. Changes nothing, and may be asked while it streams.
///
/// @return kUnavailable, naming device and step.
Result<std::string> DescribeCamera(V4l2System& system, const CameraConfig& config);

}  // namespace relocd
