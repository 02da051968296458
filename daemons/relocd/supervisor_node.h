#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/time.h"
#include "messaging/message_bus.h"
#include "supervision/supervisor.h"

namespace relocd {

/// What CONFIG says.
struct EffectiveConfig {
  std::string version;
  std::string hash;
  std::string yaml;
};

/// Publishes the supervisor's table (SUPERVISOR, twice a second and on change), the config that all
/// run with (CONFIG, every 10 s and on change) and the clocks (TIMESYNC, once a second), as far as
/// there is a bus.
///
/// Thread-bound. Reads no clock.
class SupervisorNode {
 public:
  SupervisorNode(EffectiveConfig config, std::int64_t run_id)
      : config_(std::move(config)), run_id_(run_id) {}

  /// Publishes what is due.
  ///
  /// @param bus      null while there is none.
  /// @param changes  the supervisor's: another number publishes the table at once.
  /// @return the first failure; what failed is due again next time.
  Result<void> Publish(MessageBus* bus,
                       const std::vector<ProcessReport>& reports,
                       std::int64_t changes,
                       const ClockReading& now);

  /// Another config has been taken over.
  void SetConfig(EffectiveConfig config);

 private:
  Result<void> PublishTable(MessageBus& bus,
                            const std::vector<ProcessReport>& reports,
                            const ClockReading& now);
  Result<void> PublishConfig(MessageBus& bus, const ClockReading& now);
  Result<void> PublishTimesync(MessageBus& bus, const ClockReading& now);

  /// Fills the fields that every message begins with.
  template <typename Message>
  void Stamp(Message& message, std::int64_t seq, const ClockReading& now) const;

  EffectiveConfig config_;
  std::int64_t run_id_;
  std::optional<MonotonicTime> table_published_;
  std::optional<MonotonicTime> config_published_;
  std::optional<ClockReading> timesync_published_;
  std::int64_t published_changes_ = -1;
  std::int64_t table_seq_ = 0;
  std::int64_t config_seq_ = 0;
  std::int64_t timesync_seq_ = 0;
};

/// The table in one line for `systemctl status`: `5/6 ready; inferenced BACKOFF (exit code 137)`.
std::string Summarize(const std::vector<ProcessReport>& reports);

/// Whether the robot can know where it is: odometryd and smootherd are ready, or not to be had (not
/// in the table, failed).
bool IsEssentialReady(const std::vector<ProcessReport>& reports);

}  // namespace relocd
