#include "can/message_guard.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "can/signal.h"

namespace relocd {
namespace {

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

/// The integer signal of a message that a rule names.
Result<DbcSignal> FindInteger(const DbcMessage& message, const char* key, const std::string& name) {
  const DbcSignal* const signal = message.FindSignal(name);
  if (signal == nullptr || !signal->is_integer() || !signal->mux_ranges.empty()) {
    return Invalid(fmt::format("{} is '{}', must be an integer of message {} that is in each frame",
                               key,
                               name,
                               message.name));
  }
  return *signal;
}

/// That a number of the rule can be told by the counter's bits.
Result<void> CheckWithinCounter(const char* key,
                                int number,
                                std::uint64_t maximum,
                                const DbcMessage& message,
                                const DbcSignal& counter) {
  if (static_cast<std::uint64_t>(number) <= maximum) return {};
  return Invalid(fmt::format("{} is {}, must be at most {}: counter signal '{}.{}' has {} bits",
                             key,
                             number,
                             maximum,
                             message.name,
                             counter.name,
                             counter.length));
}

bool IsOnByteBorders(const DbcSignal& signal) {
  return signal.start_bit % 8 == (signal.byte_order == ByteOrder::kLittleEndian ? 0 : 7);
}

}  // namespace

Result<void> MessageRule::Validate() const {
  if (counter_step < 1) {
    return Invalid(fmt::format("counter_step is {}, must be at least 1", counter_step));
  }
  if (counter_modulo != 0 && counter_modulo < 2) {
    return Invalid(fmt::format("counter_modulo is {}, must be 0 or at least 2", counter_modulo));
  }
  if (counter_modulo != 0 && counter_step >= counter_modulo) {
    return Invalid(fmt::format("counter_step is {}, must be below the counter_modulo of {}",
                               counter_step,
                               counter_modulo));
  }
  const auto rule = ParseChecksumRule(checksum_rule);
  if (!rule) return Invalid("checksum_rule " + rule.error().message);
  if (checksum.empty() != (*rule == ChecksumRule::kNone)) {
    return Invalid(fmt::format(
        "checksum_rule is '{}' and checksum '{}', must be none with an empty signal, and "
        "not none with one",
        checksum_rule,
        checksum));
  }
  if (*rule == ChecksumRule::kAutosarP1Alternating && counter.empty()) {
    return Invalid("counter is '', must be given with autosar_p1_alternating");
  }
  if (data_id < 0 || data_id > std::numeric_limits<std::uint16_t>::max()) {
    return Invalid(fmt::format("data_id is {}, must be in [0, 65535]", data_id));
  }
  if (!(max_age_s > 0.0) || !(max_age_s < 1e6)) {
    return Invalid(fmt::format("max_age_s is {}, must be in (0, 1e6)", max_age_s));
  }
  return {};
}

Result<MessageGuard> MessageGuard::Create(const MessageRule& rule, const DbcMessage& message) {
  if (auto ok = rule.Validate(); !ok) return std::move(ok).error();
  MessageGuard guard(message.size);
  guard.max_age_ = FromSeconds(rule.max_age_s);
  guard.data_id_ = static_cast<std::uint16_t>(rule.data_id);
  if (!rule.counter.empty()) {
    auto counter = FindInteger(message, "counter", rule.counter);
    if (!counter) return std::move(counter).error();
    if (auto ok = guard.SetCounter(rule, message, *counter); !ok) return std::move(ok).error();
  }
  if (rule.checksum.empty()) return guard;
  auto checksum = FindInteger(message, "checksum", rule.checksum);
  if (!checksum) return std::move(checksum).error();
  guard.rule_ = ParseChecksumRule(rule.checksum_rule).value();
  const int bits = ChecksumBits(guard.rule_);
  if (checksum->length != bits || (bits == 8 && !IsOnByteBorders(*checksum))) {
    return Invalid(fmt::format("checksum signal '{}.{}' has {} bits from bit {}, must have {}{}",
                               message.name,
                               rule.checksum,
                               checksum->length,
                               checksum->start_bit,
                               bits,
                               bits == 8 ? ", a whole byte" : ""));
  }
  guard.checksum_ = std::move(checksum).value();
  return guard;
}

Result<void> MessageGuard::SetCounter(const MessageRule& rule,
                                      const DbcMessage& message,
                                      const DbcSignal& counter) {
  counter_ = counter;
  step_ = static_cast<std::uint64_t>(rule.counter_step);
  modulo_ = static_cast<std::uint64_t>(rule.counter_modulo);
  if (counter.length == 64) return {};
  const std::uint64_t range = std::uint64_t{1} << static_cast<unsigned>(counter.length);
  if (modulo_ == 0) modulo_ = range;
  if (auto ok = CheckWithinCounter("counter_modulo", rule.counter_modulo, range, message, counter);
      !ok) {
    return ok;
  }
  return CheckWithinCounter("counter_step", rule.counter_step, range - 1, message, counter);
}

bool MessageGuard::HasRightChecksum(const CanFrame& frame) const {
  const ChecksumContext context{
      .data_id = data_id_,
      .count = counter_ ? DecodeBits(*counter_, frame.payload()).value_or(0) : 0};
  return DecodeBits(*checksum_, frame.payload()) == Checksum(rule_, frame, *checksum_, context);
}

std::uint64_t MessageGuard::Advance(std::uint64_t before, std::uint64_t after) const {
  if (modulo_ == 0) return after - before;
  return (after % modulo_ + modulo_ - before % modulo_) % modulo_;
}

MessageGuard::Judgement MessageGuard::Judge(const CanFrame& frame) {
  ++counters_.frames;
  if (frame.size < size_) {
    ++counters_.short_frames;
    return {.verdict = FrameVerdict::kShort};
  }
  if (checksum_ && !HasRightChecksum(frame)) {
    ++counters_.bad_checksums;
    return {.verdict = FrameVerdict::kBadChecksum};
  }
  Judgement judgement;
  if (counter_) {
    const std::uint64_t count = DecodeBits(*counter_, frame.payload()).value_or(0);
    const std::uint64_t advance = last_count_ ? Advance(*last_count_, count) : step_;
    last_count_ = count;
    if (advance == 0) {
      ++counters_.stuck_counters;
      return {.verdict = FrameVerdict::kStuckCounter};
    }
    constexpr std::uint64_t kMost = 1'000'000;  // a wider counter that jumped is one set anew
    judgement.missing_frames = static_cast<int>(std::min((advance - 1) / step_, kMost));
    counters_.missing_frames += judgement.missing_frames;
  }
  return judgement;
}

}  // namespace relocd
