#include "simulation/wheel_simulator.h"

#include <utility>

#include <fmt/format.h>

#include "simulation/wheel_frame_encoder.h"

namespace relocd {

Result<std::vector<CandumpRecord>> SimulateWheelFrames(const std::vector<WheelMotion>& motions,
                                                       const OdometryConfig& vehicle,
                                                       const DbcFile& dbc,
                                                       const WheelSimulationOptions& options) {
  if (auto ok = options.Validate(); !ok) return std::move(ok).error();
  auto encoder = WheelFrameEncoder::Create(vehicle, dbc, options);
  if (!encoder) return std::move(encoder).error();
  WheelSensors sensors(options, vehicle.drive.wheel_sigma_m_per_sqrt_m);
  std::vector<CandumpRecord> records;
  for (const WheelMotion& motion : motions) {
    auto frames = encoder->Encode(sensors.Measure(motion));
    if (!frames) return std::move(frames).error();
    for (CanFrame& frame : *frames) {
      frame.receive_time = FromNanoseconds(motion.time_ns);
      records.push_back(
          {.time_ns = motion.time_ns, .interface = options.interface, .frame = frame});
    }
  }
  return records;
}

Result<SimulatedDrive> SimulateWheels(const Trajectory2& X_WBs,
                                      const OdometryConfig& vehicle,
                                      const DbcFile& dbc,
                                      const WheelSimulationOptions& options) {
  if (auto ok = options.Validate(); !ok) return std::move(ok).error();
  if (X_WBs.size() < 2) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("the trajectory has {} poses, must have at least 2", X_WBs.size())};
  }
  const auto motions = RollWheels(X_WBs, {.track_m = vehicle.drive.track_m}, options.period_ns());
  auto frames = SimulateWheelFrames(motions, vehicle, dbc, options);
  if (!frames) return std::move(frames).error();
  SimulatedDrive drive{.frames = std::move(frames).value(), .X_WBs = {}};
  for (const WheelMotion& motion : motions)
    drive.X_WBs.push_back({.time_ns = motion.time_ns, .X_WB = motion.X_WB});
  return drive;
}

}  // namespace relocd
