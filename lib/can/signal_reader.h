#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>

#include "can/can_frame.h"
#include "can/dbc.h"
#include "can/message_guard.h"
#include "core/result.h"
#include "core/time.h"

namespace relocd {

/// The values of one signal, of frames that are new and whole.
///
/// Thread-bound.
class SignalReader {
 public:
  /// @param full_name  `MESSAGE.SIGNAL`.
  /// @param rules      by the message's name.
  /// @return kInvalidInput, as DbcFile::FindSignal and MessageGuard::Create.
  static Result<SignalReader> Create(const std::string& full_name,
                                     const DbcFile& dbc,
                                     const std::map<std::string, MessageRule>& rules);

  /// The value, if the frame has it and is valid.
  std::optional<double> Handle(const CanFrame& frame);

  /// The last value, unless it is too old.
  [[nodiscard]] std::optional<double> ValueAt(MonotonicTime now) const {
    return value_ && now - value_time_ <= guard_.max_age() ? value_ : std::nullopt;
  }
  /// For how long a value is valid.
  [[nodiscard]] Duration max_age() const { return guard_.max_age(); }
  [[nodiscard]] CanId id() const { return message_.id; }
  [[nodiscard]] const DbcSignal& signal() const { return signal_; }
  [[nodiscard]] const MessageGuard::Counters& counters() const { return guard_.counters(); }

 private:
  SignalReader(DbcMessage message, DbcSignal signal, MessageGuard guard)
      : message_(std::move(message)), signal_(std::move(signal)), guard_(std::move(guard)) {}

  DbcMessage message_;
  DbcSignal signal_;
  MessageGuard guard_;
  std::optional<double> value_;
  MonotonicTime value_time_{};
};

}  // namespace relocd
