#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "can/dbc.h"
#include "core/result.h"
#include "geometry/trajectory.h"
#include "odometry/wheel_odometry.h"

namespace relocd {

/// What a vehicle's sensors said on a drive, added up.
struct OdometryRecording {
  /// Rear left, rear right, front left, front right.
  static constexpr std::size_t kWheels = 4;

  struct Sample {
    double time_s = 0.0;                     ///< Since origin_ns.
    std::array<double, kWheels> travel_m{};  ///< Since the begin, as the config scales it.
    double yaw_rad = 0.0;       ///< The yaw rate added up since the begin, without any correction.
    double steering_rad = 0.0;  ///< The sensor's angle, in its own unit made to radians.
    bool is_slipping = false;   ///< In the interval that ends here.
  };

  std::int64_t origin_ns = 0;
  std::vector<Sample> samples;
  bool has_front = false;
  bool has_yaw_rate = false;
  bool has_steering = false;
  /// What odometry made of it with the config: X_OB at the samples' times.
  Trajectory2 X_OBs;
  /// What of the log was no frame and left out, for a person; empty if nothing was.
  std::string left_out;
};

/// Collects the recording of frames, by the product's own odometry.
class OdometryRecorder {
 public:
  /// @return kInvalidInput, as WheelOdometry::Create.
  static Result<OdometryRecorder> Create(const OdometryConfig& config,
                                         const DbcFile& dbc,
                                         const WheelSignals::Rules& rules);

  void Handle(const CanFrame& frame);

  [[nodiscard]] const OdometryRecording& recording() const { return recording_; }

 private:
  OdometryRecorder(const OdometryConfig& config, WheelOdometry odometry)
      : config_(config), odometry_(std::move(odometry)) {}

  void AddSample(const OdometryIncrement& increment);
  [[nodiscard]] std::array<double, OdometryRecording::kWheels> Speeds() const;

  OdometryConfig config_;
  WheelOdometry odometry_;
  OdometryRecording recording_;
  std::array<double, OdometryRecording::kWheels> last_speeds_mps_{};
  double yaw_rad_ = 0.0;
  std::optional<std::pair<MonotonicTime, double>> last_yaw_rate_;
};

/// The same of a candump log.
///
/// @return kInvalidInput also when the log has no wheel measurement on the interface.
Result<OdometryRecording> RecordOdometry(const std::string& can_log,
                                         const std::string& interface,
                                         OdometryRecorder recorder);

/// The same of motions `time_ns,dx_m,dy_m,dtheta_rad`, as two wheels of this track would have had
/// them.
Result<OdometryRecording> RecordMotions(const std::string& csv, double track_m);

}  // namespace relocd
