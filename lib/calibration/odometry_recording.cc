#include "calibration/odometry_recording.h"

#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "can/candump_log.h"
#include "core/csv.h"

namespace relocd {

Result<OdometryRecorder> OdometryRecorder::Create(const OdometryConfig& config,
                                                  const DbcFile& dbc,
                                                  const WheelSignals::Rules& rules) {
  auto odometry = WheelOdometry::Create(config, dbc, rules);
  if (!odometry) return std::move(odometry).error();
  OdometryRecorder recorder(config, std::move(odometry).value());
  recorder.recording_.has_front = recorder.odometry_.signals().has_front();
  recorder.recording_.has_yaw_rate = !config.yaw_rate.signal.empty();
  recorder.recording_.has_steering = !config.steering.signal.empty();
  return recorder;
}

void OdometryRecorder::Handle(const CanFrame& frame) {
  const auto increment = odometry_.Handle(frame);
  if (const auto& rate = odometry_.last_yaw_rate()) {
    if (last_yaw_rate_) {
      yaw_rad_ += 0.5 * (last_yaw_rate_->second + rate->second) *
                  ToSeconds(rate->first - last_yaw_rate_->first);
    }
    last_yaw_rate_ = rate;
  }
  if (increment) AddSample(*increment);
}

std::array<double, OdometryRecording::kWheels> OdometryRecorder::Speeds() const {
  const WheelSample& sample = *odometry_.last_sample();
  const DifferentialDriveConfig& drive = config_.drive;
  return {sample.speeds_mps[0] * drive.left_scale,
          sample.speeds_mps[1] * drive.right_scale,
          sample.front_speeds_mps[0] * drive.front_left_scale,
          sample.front_speeds_mps[1] * drive.front_right_scale};
}

void OdometryRecorder::AddSample(const OdometryIncrement& increment) {
  std::vector<OdometryRecording::Sample>& samples = recording_.samples;
  if (samples.empty()) recording_.origin_ns = ToNanoseconds(increment.time);
  OdometryRecording::Sample sample;
  sample.time_s = 1e-9 * static_cast<double>(ToNanoseconds(increment.time) - recording_.origin_ns);
  sample.is_slipping = (increment.flags & kOdometrySlip) != 0;
  if (increment.ticks) {
    const DifferentialDriveConfig& drive = config_.drive;
    const double turn = 2.0 * std::numbers::pi / drive.ticks_per_revolution;
    const auto& ticks = *increment.ticks;
    sample.travel_m[0] =
        turn * drive.left_radius_m * drive.left_scale * static_cast<double>(ticks[0]);
    sample.travel_m[1] =
        turn * drive.right_radius_m * drive.right_scale * static_cast<double>(ticks[1]);
  } else {
    const auto speeds_mps = Speeds();
    const OdometryRecording::Sample& before = samples.empty() ? sample : samples.back();
    const double half_s = 0.5 * (sample.time_s - before.time_s);
    for (std::size_t i = 0; i < speeds_mps.size(); ++i) {
      sample.travel_m.at(i) =
          before.travel_m.at(i) + half_s * (last_speeds_mps_.at(i) + speeds_mps.at(i));
    }
    last_speeds_mps_ = speeds_mps;
  }
  sample.yaw_rad = yaw_rad_;
  if (last_yaw_rate_)
    sample.yaw_rad += last_yaw_rate_->second * ToSeconds(increment.time - last_yaw_rate_->first);
  const auto steering_rad = odometry_.SteeringAt(increment.time);
  const double last_rad = samples.empty() ? 0.0 : samples.back().steering_rad;
  const SteeringConfig& steering = config_.steering;
  sample.steering_rad =
      steering_rad ? *steering_rad * steering.ratio + steering.offset_rad : last_rad;
  samples.push_back(sample);
  recording_.X_OBs.push_back({.time_ns = ToNanoseconds(increment.time), .X_WB = increment.X_OB});
}

Result<OdometryRecording> RecordOdometry(const std::string& can_log,
                                         const std::string& interface,
                                         OdometryRecorder recorder) {
  auto log = CandumpLog::Open(can_log);
  if (!log) return std::move(log).error();
  while (true) {
    auto frame = log->NextDataFrame(interface);
    if (!frame) return std::move(frame).error();
    if (!frame->has_value()) break;
    recorder.Handle(**frame);
  }
  if (recorder.recording().samples.size() < 2) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: has {} wheel measurements on {}, must have at least 2",
                             can_log,
                             recorder.recording().samples.size(),
                             interface)};
  }
  OdometryRecording recording = recorder.recording();
  recording.left_out = log->LeftOut();
  return recording;
}

Result<OdometryRecording> RecordMotions(const std::string& csv, double track_m) {
  auto table = CsvTable::Read(csv);
  if (!table) return std::move(table).error();
  auto columns = table->Columns({"time_ns", "dx_m", "dy_m", "dtheta_rad"});
  if (!columns) return std::move(columns).error();
  OdometryRecording recording;
  OdometryRecording::Sample sample;
  Pose2 X_OB;
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    auto time_ns = table->Int64(row, (*columns)[0]);
    if (!time_ns) return std::move(time_ns).error();
    std::array<double, 3> motion{};
    for (std::size_t i = 0; i < motion.size(); ++i) {
      auto cell = table->Double(row, (*columns)[i + 1]);
      if (!cell) return std::move(cell).error();
      motion.at(i) = *cell;
    }
    if (row == 0) recording.origin_ns = *time_ns;
    const double time_s = 1e-9 * static_cast<double>(*time_ns - recording.origin_ns);
    if (row > 0 && !(time_s > sample.time_s)) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: time_ns is {}, must increase", table->Where(row), *time_ns)};
    }
    const Pose2 X_BiBj(motion[0], motion[1], motion[2]);
    const Eigen::Vector3d tangent = X_BiBj.Log();
    sample.time_s = time_s;
    sample.travel_m[0] += tangent.x() - 0.5 * track_m * tangent.z();
    sample.travel_m[1] += tangent.x() + 0.5 * track_m * tangent.z();
    X_OB = X_OB * X_BiBj;
    recording.samples.push_back(sample);
    recording.X_OBs.push_back({.time_ns = *time_ns, .X_WB = X_OB});
  }
  if (recording.samples.size() < 2) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("{}: has {} rows, must have at least 2", csv, recording.samples.size())};
  }
  return recording;
}

}  // namespace relocd
