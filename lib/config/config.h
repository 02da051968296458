#pragma once

#include <map>
#include <string>
#include <vector>

#include "camera/camera_config.h"
#include "can/can_config.h"
#include "core/result.h"
#include "geometry/pose3.h"
#include "odometry/wheel_odometry.h"
#include "recording/recorder_config.h"
#include "relocalization/inference_config.h"
#include "smoothing/localization_config.h"
#include "supervision/process_spec.h"

namespace relocd {

/// The two LCM networks. They must differ in the port: LCM binds to every address, so groups do not
/// separate.
struct BusConfig {
  std::string control_url = "udpm://239.255.76.67:7667?ttl=0";
  std::string image_url = "udpm://239.255.76.67:7668?ttl=0&recv_buf_size=4194304";

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("control_url", self.control_url, "all messages but images");
    visit("image_url", self.image_url, "IMAGE_<camera>; another port than control_url's");
  }
  [[nodiscard]] Result<void> Validate() const;
};

/// All that a robot's YAML file says: the modules' structs, put together.
struct Config {
  BusConfig bus;
  std::map<std::string, CameraConfig> cameras{{"front", CameraConfig()}};
  CanConfig can;
  OdometryConfig odometry;
  InferenceConfig inference;
  LocalizationConfig localization;
  RecorderConfig recorder;
  SupervisionConfig supervisor;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("bus", self.bus, "The LCM networks between the daemons.");
    visit("cameras",
          self.cameras,
          "camerad: one for each camera, by a name of letters, digits and _.");
    visit("can", self.can, "odometryd: where the vehicle's CAN frames come from.");
    visit("odometry", self.odometry, "odometryd: how the wheels move the body.");
    visit("inference", self.inference, "inferenced: how images become camera poses.");
    visit("localization",
          self.localization,
          "smootherd: how odometry and camera poses become the vehicle's pose.");
    visit("recorder", self.recorder, "recorderd: what is kept of the messages.");
    visit("supervisor", self.supervisor, "relocd: the daemons it starts and watches.");
  }

  /// @return kInvalidInput; the message begins with the full name of the key.
  [[nodiscard]] Result<void> Validate() const;

  /// X_BC of each camera, by its name.
  [[nodiscard]] std::map<std::string, Pose3> CameraMountings() const;
};

/// Reads, checks and completes a config.
///
/// @param path       of the file; empty: the defaults. Paths in it are relative to its folder, and
///                   absolute in the result.
/// @param overrides  `section.key=value`, put over the file's.
/// @return kInvalidInput with file, line, key, value and what is allowed; kUnavailable when the
/// file cannot be read.
Result<Config> LoadConfig(const std::string& path, const std::vector<std::string>& overrides);

/// Every key with its comment; LoadConfig reads it back to the same.
std::string FormatConfig(const Config& config);

/// The first 16 hex digits of the sha256 of the formatted config.
std::string ConfigHash(const Config& config);

}  // namespace relocd
