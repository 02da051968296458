#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "can/can_frame.h"
#include "can/checksum.h"
#include "can/dbc.h"
#include "core/result.h"
#include "core/time.h"

namespace relocd {

/// How a message of the DBC file shows that it is new and whole.
struct MessageRule {
  std::string counter{};
  int counter_step = 1;
  int counter_modulo = 0;
  std::string checksum{};
  std::string checksum_rule = "none";
  int data_id = 0;
  double max_age_s = 0.5;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("counter", self.counter, "the signal that counts the frames; may be empty");
    visit("counter_step",
          self.counter_step,
          ">= 1, below what the counter can count; from one frame to the next");
    visit("counter_modulo",
          self.counter_modulo,
          "0, or >= 2 where the counter wraps earlier than its bits: 15 in AUTOSAR's profile 1");
    visit("checksum", self.checksum, "the signal that holds the checksum; may be empty");
    visit(
        "checksum_rule",
        self.checksum_rule,
        "none, toyota, honda, xor8, crc8_j1850 (of all bytes, its own as 0), crc8_j1850_rest (of "
        "the other bytes), autosar_p1, autosar_p1_low, autosar_p1_alternating, autosar_p1_nibble");
    visit("data_id", self.data_id, "in [0, 65535]; autosar_p1...: the data identifier");
    visit("max_age_s", self.max_age_s, "> 0; older values are no longer valid");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// What a guard says of a frame.
enum class FrameVerdict { kValid, kShort, kBadChecksum, kStuckCounter };

/// Judges the frames of one message by length, checksum and counter.
///
/// Thread-bound.
class MessageGuard {
 public:
  /// @return kInvalidInput when the message has not the rule's signals, or they do not fit the
  /// rule.
  static Result<MessageGuard> Create(const MessageRule& rule, const DbcMessage& message);

  struct Judgement {
    FrameVerdict verdict = FrameVerdict::kValid;
    int missing_frames = 0;  ///< Between the frame before and this one, by the counter.
  };
  /// The frame must be of the guard's message.
  Judgement Judge(const CanFrame& frame);

  /// For how long a value of a frame is valid.
  [[nodiscard]] Duration max_age() const { return max_age_; }

  struct Counters {
    std::int64_t frames = 0;
    std::int64_t bad_checksums = 0;   ///< Refused.
    std::int64_t stuck_counters = 0;  ///< Refused: the same count as the frame before.
    std::int64_t short_frames = 0;    ///< Refused: not as long as the DBC file says.
    std::int64_t missing_frames = 0;  ///< By the counter.
    std::int64_t non_finite = 0;      ///< Refused: values that are not finite, of valid frames.

    Counters& operator+=(const Counters& more) {
      frames += more.frames;
      bad_checksums += more.bad_checksums;
      stuck_counters += more.stuck_counters;
      short_frames += more.short_frames;
      missing_frames += more.missing_frames;
      non_finite += more.non_finite;
      return *this;
    }
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

  /// A value of a valid frame turned out to be NaN or infinite.
  void CountNonFinite() { ++counters_.non_finite; }

 private:
  explicit MessageGuard(int size) : size_(size) {}

  Result<void> SetCounter(const MessageRule& rule,
                          const DbcMessage& message,
                          const DbcSignal& counter);
  /// From one count to another, across the wrap.
  [[nodiscard]] std::uint64_t Advance(std::uint64_t before, std::uint64_t after) const;
  [[nodiscard]] bool HasRightChecksum(const CanFrame& frame) const;

  int size_;
  std::optional<DbcSignal> counter_;
  std::uint64_t step_ = 1;
  std::uint64_t modulo_ = 0;  ///< 0: 2^64.
  std::optional<DbcSignal> checksum_;
  ChecksumRule rule_ = ChecksumRule::kNone;
  std::uint16_t data_id_ = 0;
  Duration max_age_{};
  std::optional<std::uint64_t> last_count_;
  Counters counters_;
};

}  // namespace relocd
