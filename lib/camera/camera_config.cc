#include "camera/camera_config.h"

#include <limits>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "camera/config_checks.h"
#include "camera/jpeg.h"
#include "core/index_range.h"

namespace relocd {
namespace {

constexpr int kMinImageSide = 16;
constexpr double kMillisecondsPerSecond = 1e3;
constexpr double kMinFramesInTimeout = 3.0;

Result<void> CheckMounting(const CameraConfig& config) {
  constexpr double kFarthest = 100.0;
  constexpr double kFullTurn = 2.0 * std::numbers::pi;
  for (const double value : config.X_BC_translation_m) {
    if (auto ok = CheckRange("X_BC_translation_m", value, -kFarthest, kFarthest); !ok) return ok;
  }
  for (const double value : config.X_BC_roll_pitch_yaw_rad) {
    if (auto ok = CheckRange("X_BC_roll_pitch_yaw_rad", value, -kFullTurn, kFullTurn); !ok) {
      return ok;
    }
  }
  return {};
}

Result<void> CheckTimes(const CameraConfig& config) {
  if (auto ok = CheckRange("frame_rate_hz", config.frame_rate_hz, 0.1, 240.0); !ok) return ok;
  if (auto ok = CheckRange("no_frame_timeout_ms", config.no_frame_timeout_ms, 100, 60'000); !ok) {
    return ok;
  }
  const double least_ms = kMinFramesInTimeout * kMillisecondsPerSecond / config.frame_rate_hz;
  if (config.no_frame_timeout_ms < least_ms) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("no_frame_timeout_ms is {}, must be at least {:.0f}: 3 frames at {} Hz",
                    config.no_frame_timeout_ms,
                    least_ms,
                    config.frame_rate_hz)};
  }
  return CheckRange("time_offset_ms", config.time_offset_ms, -1000.0, 1000.0);
}

}  // namespace

Result<void> FileCameraConfig::Validate() const {
  if (dataset.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 "dataset is '', must name a folder when the driver is file"};
  }
  if (auto range = ParseIndexRange(frames, std::numeric_limits<int>::max()); !range) {
    return std::move(range).error().WithContext("frames");
  }
  if (auto ok = CheckRange("rate", rate, 0.0, 1000.0); !ok) return ok;
  return CheckRange("playback_start_s", playback_start_s, 0.0, 1e10);
}

Result<void> CameraConfig::Validate() const {
  if (auto ok = CheckOneOf("driver", driver, "v4l2", "file"); !ok) return ok;
  if (auto ok = CheckMounting(*this); !ok) return ok;
  if (driver == "file") {
    if (auto ok = file.Validate(); !ok) {
      return Error{ok.error().kind, "file." + ok.error().message};
    }
  }
  if (driver == "v4l2" && device.empty()) {
    return Error{ErrorKind::kInvalidInput, "device is '', must name a node as /dev/video0"};
  }
  if (auto ok = CheckRange("width", width, kMinImageSide, kMaxImageSide); !ok) return ok;
  if (auto ok = CheckRange("height", height, kMinImageSide, kMaxImageSide); !ok) return ok;
  if (auto ok = CheckOneOf("pixel_format", pixel_format, "MJPG", "YUYV", "GREY"); !ok) return ok;
  if (auto ok = CheckRange("jpeg_quality", jpeg_quality, 1, 100); !ok) return ok;
  if (auto ok = CheckRange("max_jpeg_bytes", max_jpeg_bytes, 1000, 10'000'000); !ok) return ok;
  if (auto ok = controls.Validate(); !ok) {
    return Error{ok.error().kind, "controls." + ok.error().message};
  }
  return CheckTimes(*this);
}

Pose3 CameraConfig::X_BC() const {
  const auto& [roll, pitch, yaw] = X_BC_roll_pitch_yaw_rad;
  const auto& [x, y, z] = X_BC_translation_m;
  return {RotationFromRollPitchYaw(roll, pitch, yaw), Eigen::Vector3d(x, y, z)};
}

}  // namespace relocd
