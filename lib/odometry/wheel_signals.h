#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "can/can_frame.h"
#include "can/dbc.h"
#include "can/message_guard.h"
#include "core/result.h"

namespace relocd {

/// Which signals of the DBC file tell how the wheels turn.
struct WheelSignalsConfig {
  std::string kind = "ticks";
  std::string left_signal = "WHEEL_TICKS.LEFT";
  std::string right_signal = "WHEEL_TICKS.RIGHT";
  std::string front_left_signal{};
  std::string front_right_signal{};
  double speed_unit_mps = 1.0;
  std::string counter_signal{};
  int counter_step = 1;
  std::string checksum_signal{};
  std::string checksum_rule = "none";

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("kind", self.kind, "ticks (free-running counters) or speed");
    visit(
        "left_signal", self.left_signal, "MESSAGE.SIGNAL of the left wheel, on a car the rear one");
    visit("right_signal", self.right_signal, "MESSAGE.SIGNAL of the right wheel");
    visit("front_left_signal",
          self.front_left_signal,
          "speed: of a car's front wheel, against which slip is checked; may be empty");
    visit("front_right_signal", self.front_right_signal, "the same on the right side");
    visit("speed_unit_mps",
          self.speed_unit_mps,
          "> 0; speed: m/s of one unit of the signals, 0.2777777777777778 for km/h");
    visit("counter_signal",
          self.counter_signal,
          "counts the frames of the left wheel's message; may be empty");
    visit("counter_step", self.counter_step, ">= 1; from one frame to the next");
    visit("checksum_signal", self.checksum_signal, "in the left wheel's message; may be empty");
    visit("checksum_rule",
          self.checksum_rule,
          "none, or as in can.messages, which is the place for the rules of more than one message");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// One set of wheel measurements: ticks or speeds, as the config says.
struct WheelSample {
  MonotonicTime time{};                  ///< When the frame that completed the set was received.
  std::array<std::uint64_t, 2> ticks{};  ///< Counters of the left and the right wheel.
  std::array<double, 2> speeds_mps{};    ///< Of the left and the right wheel.
  std::array<double, 2> front_speeds_mps{};  ///< Of the front wheels, if the config names them.
  int refused_frames = 0;  ///< Since the set before: bad checksum, or a counter that stands.
  int missing_frames = 0;  ///< Since the set before, by the counter.
};

/// Picks the wheel measurements out of CAN frames.
///
/// Thread-bound.
class WheelSignals {
 public:
  using Rules = std::map<std::string, MessageRule>;  ///< By the message's name.

  /// @param rules  for any of the messages; the config's own is of the left wheel's.
  /// @return kInvalidInput, naming the DBC file, the signal and the nearest names, when the file
  ///         has no such signal; or what the signals cannot do together.
  static Result<WheelSignals> Create(const WheelSignalsConfig& config,
                                     const DbcFile& dbc,
                                     const Rules& rules = {});

  /// The set of measurements that this frame completes.
  std::optional<WheelSample> Handle(const CanFrame& frame);

  [[nodiscard]] bool are_ticks() const { return are_ticks_; }
  [[nodiscard]] bool has_front() const { return inputs_.size() > 2; }
  /// Bits of the left and the right wheel's counter.
  [[nodiscard]] std::array<int, 2> counter_bits() const;
  /// The step between two speeds that the left and the right signal can tell apart.
  [[nodiscard]] std::array<double, 2> speed_resolution_mps() const;
  /// The frames that it needs, each once.
  [[nodiscard]] std::vector<CanId> ids() const;

  /// Of all messages with wheel signals.
  [[nodiscard]] MessageGuard::Counters counters() const;

 private:
  /// One wheel's signal, and its value if this set has it already.
  struct Input {
    std::string name;
    DbcMessage message;
    DbcSignal signal;
    std::optional<std::uint64_t> bits;
    double value = 0.0;  ///< m/s, for speeds.
    MonotonicTime time{};
  };

  WheelSignals() = default;

  Result<void> AddInput(const std::string& name, const DbcFile& dbc);
  Result<void> AddGuards(const WheelSignalsConfig& config, const DbcFile& dbc, const Rules& rules);
  /// Whether the frame may be used. Remembers why not.
  bool Accept(const CanFrame& frame);
  void Store(const CanFrame& frame, Input& input);
  std::optional<WheelSample> TakeCompleteSet(MonotonicTime time);

  bool are_ticks_ = true;
  double speed_unit_mps_ = 1.0;
  std::vector<Input> inputs_;  ///< Left, right, and perhaps front left, front right.
  std::map<CanId, MessageGuard> guards_;
  int refused_frames_ = 0;
  int missing_frames_ = 0;
};

}  // namespace relocd
