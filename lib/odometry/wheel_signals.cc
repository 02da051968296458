#include "odometry/wheel_signals.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "can/signal.h"

namespace relocd {
namespace {

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

bool IsInteger(const DbcSignal& signal) {
  return signal.type == RawType::kUnsigned || signal.type == RawType::kSigned;
}

}  // namespace

Result<void> WheelSignalsConfig::Validate() const {
  if (kind != "ticks" && kind != "speed") {
    return Invalid(fmt::format("kind is '{}', must be one of ticks, speed", kind));
  }
  if (left_signal.empty()) return Invalid("left_signal is empty, must be MESSAGE.SIGNAL");
  if (right_signal.empty()) return Invalid("right_signal is empty, must be MESSAGE.SIGNAL");
  if (front_left_signal.empty() != front_right_signal.empty()) {
    return Invalid(fmt::format(
        "front_right_signal is '{}' and front_left_signal '{}', must be both given or both empty",
        front_right_signal,
        front_left_signal));
  }
  if (!front_left_signal.empty() && kind != "speed") {
    return Invalid(
        fmt::format("front_left_signal is '{}', must be empty with kind ticks", front_left_signal));
  }
  if (!(speed_unit_mps > 0.0) || !std::isfinite(speed_unit_mps)) {
    return Invalid(
        fmt::format("speed_unit_mps is {}, must be positive and finite", speed_unit_mps));
  }
  if (counter_step < 1) {
    return Invalid(fmt::format("counter_step is {}, must be at least 1", counter_step));
  }
  const auto rule = ParseChecksumRule(checksum_rule);
  if (!rule) return Invalid("checksum_rule " + rule.error().message);
  if (checksum_signal.empty() != (*rule == ChecksumRule::kNone)) {
    return Invalid(
        fmt::format("checksum_rule is '{}' and checksum_signal '{}', must be none with "
                    "an empty signal, and not none with one",
                    checksum_rule,
                    checksum_signal));
  }
  return {};
}

Result<WheelSignals> WheelSignals::Create(const WheelSignalsConfig& config, const DbcFile& dbc) {
  if (auto ok = config.Validate(); !ok) return std::move(ok).error();
  WheelSignals signals;
  signals.are_ticks_ = config.kind == "ticks";
  signals.speed_unit_mps_ = config.speed_unit_mps;
  for (const std::string& name : {config.left_signal,
                                  config.right_signal,
                                  config.front_left_signal,
                                  config.front_right_signal}) {
    if (name.empty()) continue;
    if (auto ok = signals.AddInput(name, dbc); !ok) return std::move(ok).error();
  }
  if (auto ok = signals.AddGuards(config, dbc); !ok) return std::move(ok).error();
  return signals;
}

Result<void> WheelSignals::AddInput(const std::string& name, const DbcFile& dbc) {
  auto found = dbc.FindSignal(name);
  if (!found) return std::move(found).error();
  const DbcSignal& signal = *found->signal;
  if (are_ticks_ && (!IsInteger(signal) || signal.length > 63)) {
    return Invalid(
        fmt::format("{}: signal '{}' is a {}-bit {}, must be an integer of at most 63 "
                    "bits to count ticks",
                    dbc.path(),
                    name,
                    signal.length,
                    IsInteger(signal) ? "integer" : "floating-point number"));
  }
  inputs_.push_back({.name = name,
                     .message = *found->message,
                     .signal = signal,
                     .bits = std::nullopt,
                     .value = 0.0});
  return {};
}

Result<void> WheelSignals::AddGuards(const WheelSignalsConfig& config, const DbcFile& dbc) {
  if (!config.counter_signal.empty()) {
    auto counter = FindGuard("counter_signal", config.counter_signal, dbc);
    if (!counter) return std::move(counter).error();
    counter_ = std::move(counter).value();
    counter_step_ = static_cast<std::uint64_t>(config.counter_step);
  }
  if (config.checksum_signal.empty()) return {};
  auto checksum = FindGuard("checksum_signal", config.checksum_signal, dbc);
  if (!checksum) return std::move(checksum).error();
  if (checksum->length != 8) {
    return Invalid(fmt::format("{}: checksum signal '{}' has {} bits, must have 8",
                               dbc.path(),
                               config.checksum_signal,
                               checksum->length));
  }
  checksum_ = std::move(checksum).value();
  checksum_rule_ = ParseChecksumRule(config.checksum_rule).value();
  return {};
}

Result<DbcSignal> WheelSignals::FindGuard(const char* key,
                                          const std::string& name,
                                          const DbcFile& dbc) const {
  auto found = dbc.FindSignal(name);
  if (!found) return std::move(found).error();
  if (found->message->id != inputs_.front().message.id || !IsInteger(*found->signal)) {
    return Invalid(fmt::format("{}: {} '{}', must be an integer in message {}",
                               dbc.path(),
                               key,
                               name,
                               inputs_.front().message.name));
  }
  return *found->signal;
}

std::array<int, 2> WheelSignals::counter_bits() const {
  return {inputs_[0].signal.length, inputs_[1].signal.length};
}

std::array<double, 2> WheelSignals::speed_resolution_mps() const {
  return {std::abs(inputs_[0].signal.factor) * speed_unit_mps_,
          std::abs(inputs_[1].signal.factor) * speed_unit_mps_};
}

std::vector<CanId> WheelSignals::ids() const {
  std::vector<CanId> ids;
  for (const Input& input : inputs_) {
    if (std::find(ids.begin(), ids.end(), input.message.id) == ids.end()) {
      ids.push_back(input.message.id);
    }
  }
  return ids;
}

std::optional<WheelSample> WheelSignals::Handle(const CanFrame& frame) {
  bool accepted = false;
  for (Input& input : inputs_) {
    if (input.message.id != frame.id) continue;
    if (!accepted && !Accept(frame, input.message)) return std::nullopt;
    accepted = true;
    Store(frame, input);
  }
  if (!accepted) return std::nullopt;
  return TakeCompleteSet(frame.receive_time);
}

bool WheelSignals::Accept(const CanFrame& frame, const DbcMessage& message) {
  ++counters_.frames;
  if (frame.size < message.size) {
    ++counters_.short_frames;
    ++refused_frames_;
    return false;
  }
  if (message.id != inputs_.front().message.id) return true;  // counter and checksum are not in it
  if (checksum_ &&
      DecodeBits(*checksum_, frame.payload()) != Checksum(checksum_rule_, frame, *checksum_)) {
    ++counters_.bad_checksums;
    ++refused_frames_;
    return false;
  }
  return !counter_ || CheckCounter(frame);
}

bool WheelSignals::CheckCounter(const CanFrame& frame) {
  const auto count = DecodeBits(*counter_, frame.payload());
  if (!count) return false;
  const std::uint64_t mask = ~std::uint64_t{0} >> static_cast<unsigned>(64 - counter_->length);
  const std::uint64_t advance = last_count_ ? (*count - *last_count_) & mask : counter_step_;
  last_count_ = count;
  if (advance == 0) {
    ++counters_.stuck_counters;
    ++refused_frames_;
    return false;
  }
  const auto missing = static_cast<int>((advance - 1) / counter_step_);
  missing_frames_ += missing;
  counters_.missing_frames += missing;
  return true;
}

void WheelSignals::Store(const CanFrame& frame, Input& input) const {
  if (!IsPresent(input.message, input.signal, frame.payload())) return;
  const auto value = DecodeSignal(input.signal, frame.payload());
  if (!value) return;
  input.bits = DecodeBits(input.signal, frame.payload());
  input.value = *value * speed_unit_mps_;
}

std::optional<WheelSample> WheelSignals::TakeCompleteSet(MonotonicTime time) {
  const bool complete = std::all_of(
      inputs_.begin(), inputs_.end(), [](const Input& input) { return input.bits.has_value(); });
  if (!complete) return std::nullopt;
  WheelSample sample{.time = time,
                     .refused_frames = std::exchange(refused_frames_, 0),
                     .missing_frames = std::exchange(missing_frames_, 0)};
  for (std::size_t i = 0; i < 2; ++i) {
    sample.ticks.at(i) = *inputs_[i].bits;
    sample.speeds_mps.at(i) = inputs_[i].value;
    if (has_front()) sample.front_speeds_mps.at(i) = inputs_[i + 2].value;
  }
  for (Input& input : inputs_)
    input.bits.reset();
  return sample;
}

}  // namespace relocd
