#pragma once

#include <array>
#include <numbers>
#include <string>

#include "camera/camera_controls_config.h"
#include "core/result.h"
#include "geometry/pose3.h"

namespace relocd {

/// A recording that is played in a camera's place.
struct FileCameraConfig {
  std::string dataset;
  std::string frames;
  double rate = 1.0;
  double playback_start_s = 0.0;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("dataset", self.dataset, "folder with frames.txt, poses_tum.txt and intrinsics.txt");
    visit("frames", self.frames, "'A:B', from A to before B; empty for all");
    visit(
        "rate",
        self.rate,
        "[0, 1000]; times the recorded speed, 0 for as fast as possible (with the recorded times)");
    visit("playback_start_s",
          self.playback_start_s,
          ">= 0; the recorded time at which playback begins, the same as the CAN recording's");
  }
  [[nodiscard]] Result<void> Validate() const;
};

/// One camera: how its images are fetched, and where on the vehicle it is.
struct CameraConfig {
  std::string driver = "v4l2";
  std::string device = "/dev/video0";
  int width = 640;
  int height = 480;
  double frame_rate_hz = 30.0;
  std::string pixel_format = "MJPG";
  int jpeg_quality = 80;
  int max_jpeg_bytes = 60'000;
  int no_frame_timeout_ms = 1000;
  double time_offset_ms = 0.0;
  CameraControlsConfig controls;
  std::array<double, 3> X_BC_translation_m{};
  std::array<double, 3> X_BC_roll_pitch_yaw_rad{
      -std::numbers::pi / 2.0, 0.0, -std::numbers::pi / 2.0};
  FileCameraConfig file;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("driver", self.driver, "v4l2 (a camera) or file (a recording)");
    visit(
        "device", self.device, "v4l2: its node; /dev/v4l/by-id/... stays the same when replugged");
    visit("width", self.width, "[16, 8192]; v4l2: px");
    visit("height", self.height, "[16, 8192]; v4l2: px");
    visit("frame_rate_hz", self.frame_rate_hz, "[0.1, 240]; v4l2");
    visit("pixel_format",
          self.pixel_format,
          "MJPG, YUYV or GREY; v4l2: asked of the camera, the last two are encoded to JPEG here");
    visit("jpeg_quality", self.jpeg_quality, "[1, 100]; v4l2: asked of the camera, or used here");
    visit("max_jpeg_bytes",
          self.max_jpeg_bytes,
          "[1000, 10000000]; v4l2: the quality of what is encoded here is lowered to stay below; "
          "above 65400 an image takes more than one datagram and is easily lost");
    visit("no_frame_timeout_ms",
          self.no_frame_timeout_ms,
          "[100, 60000], at least 3 frames; v4l2: restart the stream, then open the device again");
    visit("time_offset_ms",
          self.time_offset_ms,
          "[-1000, 1000]; v4l2: added to the driver's time to reach the middle of the exposure");
    visit(
        "controls", self.controls, "v4l2: set each time that the camera is opened, and read back");
    visit("X_BC_translation_m",
          self.X_BC_translation_m,
          "[-100, 100]; the camera in the body frame: x forward, y left, z up from the ground");
    visit("X_BC_roll_pitch_yaw_rad",
          self.X_BC_roll_pitch_yaw_rad,
          "[-2 pi, 2 pi]; roll about x, then pitch about y, then yaw about z, fixed axes; "
          "[-pi/2, 0, -pi/2] looks forward");
    visit("file", self.file, "driver file");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;

  /// The camera (x right, y down, z forward) in the body (x forward, y left, z up).
  [[nodiscard]] Pose3 X_BC() const;
};

}  // namespace relocd
