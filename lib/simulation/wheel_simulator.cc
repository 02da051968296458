#include "simulation/wheel_simulator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <random>
#include <utility>

#include <fmt/format.h>

#include "can/checksum.h"
#include "can/signal.h"
#include "geometry/angle.h"

namespace relocd {
namespace {

/// Wheels are followed along arcs that are this much shorter than the time between two frames.
constexpr int kSubsteps = 4;

/// What the vehicle's controller knows of its wheels when it sends.
struct WheelState {
  std::array<double, 2> travel_m{};    ///< Since the start, with all errors.
  std::array<double, 2> speeds_mps{};  ///< Likewise.
};

/// Writes wheel measurements into frames.
class WheelFrameEncoder {
 public:
  static Result<WheelFrameEncoder> Create(const OdometryConfig& vehicle, const DbcFile& dbc) {
    // WheelSignals finds the same errors as the receiver would.
    auto signals = WheelSignals::Create(vehicle.wheels, dbc);
    if (!signals) return std::move(signals).error();
    return WheelFrameEncoder(vehicle, dbc, signals->has_front());
  }

  Result<std::vector<CanFrame>> Encode(const WheelState& state) {
    std::vector<CanFrame> frames;
    for (std::size_t i = 0; i < wheels_.size(); ++i) {
      CanFrame& frame = FrameOf(*wheels_[i].message, frames);
      if (auto ok = EncodeWheel(i, state, frame); !ok) return std::move(ok).error();
    }
    Protect(FrameOf(*wheels_.front().message, frames));
    return frames;
  }

 private:
  WheelFrameEncoder(const OdometryConfig& vehicle, const DbcFile& dbc, bool has_front)
      : vehicle_(vehicle) {
    const auto find = [&](const std::string& name) { return dbc.FindSignal(name).value(); };
    const WheelSignalsConfig& names = vehicle.wheels;
    wheels_ = {find(names.left_signal), find(names.right_signal)};
    if (has_front) {
      wheels_.push_back(find(names.front_left_signal));
      wheels_.push_back(find(names.front_right_signal));
    }
    if (!names.counter_signal.empty()) counter_ = *find(names.counter_signal).signal;
    if (!names.checksum_signal.empty()) checksum_ = *find(names.checksum_signal).signal;
    rule_ = ParseChecksumRule(names.checksum_rule).value();
  }

  static CanFrame& FrameOf(const DbcMessage& message, std::vector<CanFrame>& frames) {
    const auto found = std::find_if(frames.begin(), frames.end(), [&](const CanFrame& frame) {
      return frame.id == message.id;
    });
    if (found != frames.end()) return *found;
    CanFrame frame;
    frame.id = message.id;
    frame.size = static_cast<std::uint8_t>(message.size);
    frame.fd = frame.size > CanFrame::kMaxClassicalSize;
    frames.push_back(frame);
    return frames.back();
  }

  Result<void> EncodeWheel(std::size_t wheel, const WheelState& state, CanFrame& frame) const {
    const std::size_t side = wheel % 2;
    const DbcSignal& signal = *wheels_[wheel].signal;
    if (signal.mux_value) {
      EncodeBits(*wheels_[wheel].message->multiplexor(), *signal.mux_value, frame.payload());
    }
    const DifferentialDriveConfig& drive = vehicle_.drive;
    const double scale = side == 0 ? drive.left_scale : drive.right_scale;
    if (vehicle_.wheels.kind == "speed") {
      const double applied = wheel < 2 ? scale : 1.0;
      const double value = state.speeds_mps.at(side) / (applied * vehicle_.wheels.speed_unit_mps);
      return EncodeSignal(signal, value, frame.payload());
    }
    const double radius_m = side == 0 ? drive.left_radius_m : drive.right_radius_m;
    const double metres_per_tick =
        2.0 * std::numbers::pi * radius_m * scale / drive.ticks_per_revolution;
    const auto ticks =
        static_cast<std::int64_t>(std::floor(state.travel_m.at(side) / metres_per_tick));
    EncodeBits(signal, static_cast<std::uint64_t>(ticks), frame.payload());
    return {};
  }

  void Protect(CanFrame& frame) {
    if (counter_) {
      count_ += static_cast<std::uint64_t>(vehicle_.wheels.counter_step);
      EncodeBits(*counter_, count_, frame.payload());
    }
    if (checksum_) EncodeBits(*checksum_, Checksum(rule_, frame, *checksum_), frame.payload());
  }

  OdometryConfig vehicle_;
  std::vector<DbcFile::SignalReference> wheels_;  ///< Of a DBC file that outlives this.
  std::optional<DbcSignal> counter_;
  std::uint64_t count_ = 0;
  std::optional<DbcSignal> checksum_;
  ChecksumRule rule_ = ChecksumRule::kNone;
};

/// Rolls two wheels along, and adds their errors.
class NoisyWheels {
 public:
  NoisyWheels(const DifferentialDriveConfig& drive, const WheelSimulationOptions& options)
      : track_m_(drive.track_m),
        sigma_(options.wheel_sigma_m_per_sqrt_m < 0.0 ? drive.wheel_sigma_m_per_sqrt_m
                                                      : options.wheel_sigma_m_per_sqrt_m),
        options_(options),
        engine_(options.seed) {
    for (std::size_t side = 0; side < 2; ++side) {
      scale_.at(side) = 1.0 + options.radius_sigma * normal_(engine_);
      // Controllers were on for a while before a recording begins.
      state_.travel_m.at(side) = 1000.0 * std::uniform_real_distribution<double>()(engine_);
      measured_m_.at(side) = state_.travel_m.at(side);
    }
  }

  /// Sets the speeds, without error, at which the drive begins.
  void Begin(const Pose2& X_BiBj, double duration_s) {
    const std::array<double, 2> travel_m = TravelOf(X_BiBj);
    for (std::size_t side = 0; side < 2; ++side)
      state_.speeds_mps.at(side) = travel_m.at(side) / duration_s;
  }

  void Roll(const Pose2& X_BiBj) {
    const std::array<double, 2> travel_m = TravelOf(X_BiBj);
    for (std::size_t side = 0; side < 2; ++side) {
      state_.travel_m.at(side) += scale_.at(side) * travel_m.at(side) + NoiseOf(travel_m.at(side));
    }
  }

  /// Measures the speeds over the time since the last call.
  void MeasureSpeeds(double duration_s) {
    for (std::size_t side = 0; side < 2; ++side) {
      double& measured_m = measured_m_.at(side);
      state_.speeds_mps.at(side) = (state_.travel_m.at(side) - measured_m) / duration_s;
      measured_m = state_.travel_m.at(side);
    }
  }

  [[nodiscard]] const WheelState& state() const { return state_; }

 private:
  [[nodiscard]] std::array<double, 2> TravelOf(const Pose2& X_BiBj) const {
    const Eigen::Vector3d twist = X_BiBj.Log();
    const double turn_m = 0.5 * track_m_ * twist.z();
    return {twist.x() - turn_m, twist.x() + turn_m};
  }

  double NoiseOf(double travel_m) {
    double noise_m = sigma_ * std::sqrt(std::abs(travel_m)) * normal_(engine_);
    const double slips = options_.slips_per_m * std::abs(travel_m);
    if (slips > 0.0 && std::uniform_real_distribution<double>()(engine_) < slips) {
      noise_m += options_.slip_sigma_m * normal_(engine_);
    }
    return noise_m;
  }

  double track_m_;
  double sigma_;
  WheelSimulationOptions options_;
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
  std::array<double, 2> scale_{};
  std::array<double, 2> measured_m_{};  ///< The travel when the speeds were measured last.
  WheelState state_;
};

Result<void> CheckOptions(const Trajectory2& X_WBs, const WheelSimulationOptions& options) {
  const auto invalid = [](const char* name, double value, const char* allowed) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{} is {}, must be {}", name, value, allowed)};
  };
  if (!(options.rate_hz >= 1.0 && options.rate_hz <= 1000.0)) {
    return invalid("rate_hz", options.rate_hz, "in [1, 1000]");
  }
  if (!(options.radius_sigma >= 0.0 && options.radius_sigma < 0.2)) {
    return invalid("radius_sigma", options.radius_sigma, "in [0, 0.2)");
  }
  if (!(options.slips_per_m >= 0.0 && options.slips_per_m <= 100.0)) {
    return invalid("slips_per_m", options.slips_per_m, "in [0, 100]");
  }
  if (!(options.slip_sigma_m >= 0.0 && options.slip_sigma_m <= 10.0)) {
    return invalid("slip_sigma_m", options.slip_sigma_m, "in [0, 10]");
  }
  if (X_WBs.size() < 2) {
    return invalid(
        "the trajectory's length", static_cast<double>(X_WBs.size()), "at least two poses");
  }
  return {};
}

}  // namespace

SmoothTrajectory::SmoothTrajectory(const Trajectory2& X_WBs) {
  for (const TimedPose2& pose : X_WBs) {
    double heading = pose.X_WB.yaw();
    if (!knots_.empty()) {
      const double before = knots_.back().value.z();
      heading = before + WrapAngle(heading - before);
    }
    knots_.push_back({.time_ns = pose.time_ns, .value = {pose.X_WB.x(), pose.X_WB.y(), heading}});
  }
  const std::size_t last = knots_.size() - 1;
  for (std::size_t i = 0; i <= last; ++i) {
    const Knot& before = knots_[i == 0 ? 0 : i - 1];
    const Knot& after = knots_[std::min(i + 1, last)];
    knots_[i].rate =
        (after.value - before.value) / (static_cast<double>(after.time_ns - before.time_ns) * 1e-9);
  }
}

Pose2 SmoothTrajectory::At(std::int64_t time_ns) const {
  time_ns = std::clamp(time_ns, begin_ns(), end_ns());
  auto after = std::upper_bound(
      knots_.begin() + 1, knots_.end() - 1, time_ns, [](std::int64_t time, const Knot& knot) {
        return time < knot.time_ns;
      });
  const Knot& to = *after;
  const Knot& from = *std::prev(after);
  const double span_s = static_cast<double>(to.time_ns - from.time_ns) * 1e-9;
  const double s = static_cast<double>(time_ns - from.time_ns) * 1e-9 / span_s;
  // The four cubic Hermite polynomials.
  const double from_value = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s);
  const double from_rate = s * (1.0 - s) * (1.0 - s) * span_s;
  const double to_value = s * s * (3.0 - 2.0 * s);
  const double to_rate = s * s * (s - 1.0) * span_s;
  const Eigen::Vector3d value =
      from_value * from.value + from_rate * from.rate + to_value * to.value + to_rate * to.rate;
  return {value.x(), value.y(), value.z()};
}

Result<SimulatedDrive> SimulateWheels(const Trajectory2& X_WBs,
                                      const OdometryConfig& vehicle,
                                      const DbcFile& dbc,
                                      const WheelSimulationOptions& options) {
  if (auto ok = CheckOptions(X_WBs, options); !ok) return std::move(ok).error();
  auto encoder = WheelFrameEncoder::Create(vehicle, dbc);
  if (!encoder) return std::move(encoder).error();
  const SmoothTrajectory trajectory(X_WBs);
  NoisyWheels wheels(vehicle.drive, options);

  SimulatedDrive drive;
  // candump has microseconds.
  const auto period_ns = static_cast<std::int64_t>(std::llround(1e6 / options.rate_hz)) * 1000;
  const double period_s = static_cast<double>(period_ns) * 1e-9;
  const std::int64_t begin_ns = (trajectory.begin_ns() + 999) / 1000 * 1000;
  Pose2 X_WB = trajectory.At(begin_ns);
  wheels.Begin(X_WB.Inverse() * trajectory.At(begin_ns + period_ns), period_s);
  for (std::int64_t time_ns = begin_ns; time_ns <= trajectory.end_ns(); time_ns += period_ns) {
    auto frames = encoder->Encode(wheels.state());
    if (!frames) return std::move(frames).error();
    for (CanFrame& frame : *frames) {
      frame.receive_time = FromNanoseconds(time_ns);
      drive.frames.push_back({.time_ns = time_ns, .interface = options.interface, .frame = frame});
    }
    drive.X_WBs.push_back({.time_ns = time_ns, .X_WB = X_WB});
    for (int step = 1; step <= kSubsteps; ++step) {
      const Pose2 X_WBj = trajectory.At(time_ns + period_ns * step / kSubsteps);
      wheels.Roll(X_WB.Inverse() * X_WBj);
      X_WB = X_WBj;
    }
    wheels.MeasureSpeeds(period_s);
  }
  return drive;
}

}  // namespace relocd
