#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "messaging/stream_monitor.h"
#include "recording/log_event.h"
#include "recording/log_reader.h"

namespace relocd {

/// What each channel of a log holds.
class LogSummary {
 public:
  void Add(const LogEvent& event);

  [[nodiscard]] std::int64_t Events(const std::string& channel) const;
  /// Of all channels.
  [[nodiscard]] std::int64_t Lost() const;
  /// From the measurement to its arrival at the recorder; NaN for a channel that is not there or
  /// has no measurements.
  [[nodiscard]] double AgePercentileMs(const std::string& channel, double share) const;

  [[nodiscard]] std::string FormatTable(const LogReader::Counters& counters) const;
  [[nodiscard]] std::string FormatJson(const LogReader::Counters& counters) const;

 private:
  struct ChannelSummary {
    std::int64_t events = 0;
    std::int64_t bytes = 0;
    std::int64_t first_us = 0;
    std::int64_t last_us = 0;
    StreamMonitor monitor;
    /// From the measurement (utime) to its arrival at the recorder, us.
    std::vector<double> ages_us;
  };
  std::map<std::string, ChannelSummary> channels_;
};

}  // namespace relocd
