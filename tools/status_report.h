#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "relocd/localization_t.hpp"
#include "relocd/status_t.hpp"
#include "relocd/supervisor_t.hpp"

#include "core/time.h"
#include "messaging/message_bus.h"

namespace relocd {

/// Gathers what the daemons say about themselves, and tells whether all is well.
///
/// Thread-bound. Reads no clock.
class StatusReport {
 public:
  /// Subscribes to SUPERVISOR, STATUS_* and LOCALIZATION.
  ///
  /// @param bus  borrowed during the call; its handlers keep using this object.
  void Subscribe(MessageBus& bus);

  void Handle(const supervisor_t& message) { table_ = message; }
  void Handle(const status_t& message) { statuses_[message.daemon] = message; }
  void Handle(const localization_t& message);

  /// What is wrong, one line each, with what to do where that is known; empty when all is well.
  [[nodiscard]] std::vector<std::string> Problems(MonotonicTime now) const;

  /// For people: a table of processes, and the pose.
  [[nodiscard]] std::string Text(MonotonicTime now) const;

  /// For scripts.
  [[nodiscard]] std::string Json(MonotonicTime now) const;

 private:
  [[nodiscard]] bool HasHeardNothing() const;
  [[nodiscard]] bool ExpectsLocalization() const;
  [[nodiscard]] double LocalizationRate() const;

  std::optional<supervisor_t> table_;
  std::map<std::string, status_t> statuses_;
  std::optional<localization_t> localization_;
  std::int64_t localizations_ = 0;
  std::int64_t first_localization_ns_ = 0;
};

/// As in `CONVERGING`.
std::string NameOfLocalizationStatus(int status);

}  // namespace relocd
