#include "simulation/wheel_frame_encoder.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string_view>
#include <utility>

#include "can/signal.h"

namespace relocd {
namespace {

/// A message's signal of the same name as `full_name` has behind the dot.
std::optional<DbcSignal> SignalNamedLike(const DbcMessage& message, std::string_view full_name) {
  if (full_name.empty()) return std::nullopt;
  const DbcSignal* const signal = message.FindSignal(full_name.substr(full_name.find('.') + 1));
  if (signal == nullptr) return std::nullopt;
  return *signal;
}

/// An angle or its rate in the signal's unit.
double InUnitOf(const DbcSignal& signal, double radians) {
  return signal.unit.starts_with("deg") ? radians * 180.0 / std::numbers::pi : radians;
}

}  // namespace

Result<WheelFrameEncoder> WheelFrameEncoder::Create(const OdometryConfig& vehicle,
                                                    const DbcFile& dbc,
                                                    const WheelSimulationOptions& options) {
  // WheelSignals finds the same errors as the receiver would.
  auto signals = WheelSignals::Create(vehicle.wheels, dbc);
  if (!signals) return std::move(signals).error();
  WheelFrameEncoder encoder(vehicle, dbc);
  if (dbc.FindSignal(options.steering_signal))
    encoder.AddField(dbc, options.steering_signal, Field::Content::kSteering, 0);
  if (dbc.FindSignal(options.yaw_rate_signal))
    encoder.AddField(dbc, options.yaw_rate_signal, Field::Content::kYawRate, 0);
  return encoder;
}

WheelFrameEncoder::WheelFrameEncoder(const OdometryConfig& vehicle, const DbcFile& dbc)
    : vehicle_(vehicle), rule_(ParseChecksumRule(vehicle.wheels.checksum_rule).value()) {
  const WheelSignalsConfig& names = vehicle.wheels;
  std::size_t wheel = 0;
  for (const std::string& name :
       {names.left_signal, names.right_signal, names.front_left_signal, names.front_right_signal}) {
    if (!name.empty()) AddField(dbc, name, Field::Content::kWheel, wheel);
    ++wheel;
  }
}

void WheelFrameEncoder::AddField(const DbcFile& dbc,
                                 const std::string& name,
                                 Field::Content content,
                                 std::size_t wheel) {
  const DbcFile::SignalReference found = dbc.FindSignal(name).value();
  auto message = std::find_if(messages_.begin(), messages_.end(), [&](const Message& known) {
    return known.message.id == found.message->id;
  });
  if (message == messages_.end()) {
    messages_.push_back(
        {.message = *found.message,
         .counter = SignalNamedLike(*found.message, vehicle_.wheels.counter_signal),
         .checksum = SignalNamedLike(*found.message, vehicle_.wheels.checksum_signal)});
    message = std::prev(messages_.end());
  }
  fields_.push_back({.message = static_cast<std::size_t>(message - messages_.begin()),
                     .signal = *found.signal,
                     .content = content,
                     .wheel = wheel});
}

Result<std::vector<CanFrame>> WheelFrameEncoder::Encode(const WheelReading& reading) {
  std::vector<CanFrame> frames;
  for (const Message& message : messages_) {
    CanFrame frame;
    frame.id = message.message.id;
    frame.size = static_cast<std::uint8_t>(message.message.size);
    frame.fd = frame.size > CanFrame::kMaxClassicalSize;
    frames.push_back(frame);
  }
  for (const Field& field : fields_) {
    if (auto ok = EncodeField(field, reading, frames.at(field.message)); !ok)
      return std::move(ok).error();
  }
  for (std::size_t i = 0; i < frames.size(); ++i)
    Protect(messages_[i], frames[i]);
  return frames;
}

Result<void> WheelFrameEncoder::EncodeField(const Field& field,
                                            const WheelReading& reading,
                                            CanFrame& frame) const {
  const DbcMessage& message = messages_.at(field.message).message;
  for (const DbcSignal* below = &field.signal; !below->mux_ranges.empty();) {
    const DbcSignal* const multiplexor = message.FindSignal(below->multiplexor);
    EncodeBits(*multiplexor, below->mux_ranges.front().first, frame.payload());
    below = multiplexor;
  }
  switch (field.content) {
    case Field::Content::kWheel:
      return EncodeWheel(field, reading, frame);
    case Field::Content::kSteering:
      return EncodeSignal(
          field.signal, InUnitOf(field.signal, reading.steering_rad), frame.payload());
    case Field::Content::kYawRate:
      return EncodeSignal(
          field.signal, InUnitOf(field.signal, reading.yaw_rate_radps), frame.payload());
  }
  return {};
}

Result<void> WheelFrameEncoder::EncodeWheel(const Field& field,
                                            const WheelReading& reading,
                                            CanFrame& frame) const {
  const DifferentialDriveConfig& drive = vehicle_.drive;
  const bool is_left = field.wheel % 2 == 0;
  const double scale = is_left ? drive.left_scale : drive.right_scale;
  if (vehicle_.wheels.kind == "speed") {
    const double applied = field.wheel < 2 ? scale : 1.0;
    const double value =
        reading.speeds_mps.at(field.wheel) / (applied * vehicle_.wheels.speed_unit_mps);
    return EncodeSignal(field.signal, value, frame.payload());
  }
  const double radius_m = is_left ? drive.left_radius_m : drive.right_radius_m;
  const double metres_per_tick =
      2.0 * std::numbers::pi * radius_m * scale / drive.ticks_per_revolution;
  const auto ticks =
      static_cast<std::int64_t>(std::floor(reading.travel_m.at(field.wheel) / metres_per_tick));
  EncodeBits(field.signal, static_cast<std::uint64_t>(ticks), frame.payload());
  return {};
}

void WheelFrameEncoder::Protect(Message& message, CanFrame& frame) const {
  if (message.counter) {
    message.count += static_cast<std::uint64_t>(vehicle_.wheels.counter_step);
    EncodeBits(*message.counter, message.count, frame.payload());
  }
  if (message.checksum)
    EncodeBits(*message.checksum, Checksum(rule_, frame, *message.checksum), frame.payload());
}

}  // namespace relocd
