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

/// The signal's name without its message's, which must be `message`; empty for an empty one.
Result<std::string> NameInMessage(const char* key,
                                  const std::string& full_name,
                                  const DbcMessage& message) {
  const auto dot = full_name.find('.');
  if (full_name.empty() || full_name.substr(0, dot) == message.name) {
    return dot == std::string::npos ? full_name : full_name.substr(dot + 1);
  }
  return Invalid(
      fmt::format("{} is '{}', must be a signal of message {}", key, full_name, message.name));
}

/// The rule given for the message, with the counter and the checksum that the config names for the
/// wheels' message put over it.
Result<MessageRule> RuleFor(const DbcMessage& message,
                            const DbcMessage& wheels,
                            const WheelSignals::Rules& rules,
                            const WheelSignalsConfig& config) {
  const auto given = rules.find(message.name);
  MessageRule rule = given == rules.end() ? MessageRule() : given->second;
  if (message.id != wheels.id) return rule;
  auto counter = NameInMessage("counter_signal", config.counter_signal, wheels);
  if (!counter) return std::move(counter).error();
  auto checksum = NameInMessage("checksum_signal", config.checksum_signal, wheels);
  if (!checksum) return std::move(checksum).error();
  if (!counter->empty()) {
    rule.counter = *counter;
    rule.counter_step = config.counter_step;
  }
  if (!checksum->empty()) {
    rule.checksum = *checksum;
    rule.checksum_rule = config.checksum_rule;
  }
  return rule;
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

Result<WheelSignals> WheelSignals::Create(const WheelSignalsConfig& config,
                                          const DbcFile& dbc,
                                          const Rules& rules) {
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
  if (auto ok = signals.AddGuards(config, dbc, rules); !ok) return std::move(ok).error();
  return signals;
}

Result<void> WheelSignals::AddInput(const std::string& name, const DbcFile& dbc) {
  auto found = dbc.FindSignal(name);
  if (!found) return std::move(found).error();
  const DbcSignal& signal = *found->signal;
  if (are_ticks_ && (!signal.is_integer() || signal.length > 63)) {
    return Invalid(
        fmt::format("{}: signal '{}' is a {}-bit {}, must be an integer of at most 63 "
                    "bits to count ticks",
                    dbc.path(),
                    name,
                    signal.length,
                    signal.is_integer() ? "integer" : "floating-point number"));
  }
  inputs_.push_back({.name = name,
                     .message = *found->message,
                     .signal = signal,
                     .bits = std::nullopt,
                     .value = 0.0});
  return {};
}

Result<void> WheelSignals::AddGuards(const WheelSignalsConfig& config,
                                     const DbcFile& dbc,
                                     const Rules& rules) {
  for (const Input& input : inputs_) {
    auto rule = RuleFor(input.message, inputs_.front().message, rules, config);
    if (!rule) return std::move(rule).error().WithContext(dbc.path());
    auto guard = MessageGuard::Create(*rule, input.message);
    if (!guard) return std::move(guard).error().WithContext(dbc.path());
    guards_.emplace(input.message.id, std::move(guard).value());
  }
  return {};
}

MessageGuard::Counters WheelSignals::counters() const {
  MessageGuard::Counters sum;
  for (const auto& [id, guard] : guards_)
    sum += guard.counters();
  return sum;
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
    if (!accepted && !Accept(frame)) return std::nullopt;
    accepted = true;
    Store(frame, input);
  }
  if (!accepted) return std::nullopt;
  return TakeCompleteSet(frame.receive_time);
}

bool WheelSignals::Accept(const CanFrame& frame) {
  const MessageGuard::Judgement judgement = guards_.at(frame.id).Judge(frame);
  missing_frames_ += judgement.missing_frames;
  if (judgement.verdict == FrameVerdict::kValid) return true;
  ++refused_frames_;
  return false;
}

void WheelSignals::Store(const CanFrame& frame, Input& input) {
  if (!IsPresent(input.message, input.signal, frame.payload())) return;
  const auto value = DecodeSignal(input.signal, frame.payload());
  if (!value) {
    guards_.at(frame.id).CountNonFinite();
    return;
  }
  input.bits = DecodeBits(input.signal, frame.payload());
  input.value = *value * speed_unit_mps_;
  input.time = frame.receive_time;
}

std::optional<WheelSample> WheelSignals::TakeCompleteSet(MonotonicTime time) {
  for (Input& input : inputs_) {
    // What waited too long for the other messages is of another time than they are.
    if (time - input.time > guards_.at(input.message.id).max_age()) input.bits.reset();
  }
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
