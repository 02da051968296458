#include "relocd/supervisor_node.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

constexpr Duration kTablePeriod = std::chrono::milliseconds(500);
constexpr Duration kTimesyncPeriod = std::chrono::seconds(1);
constexpr Duration kConfigPeriod = std::chrono::seconds(10);

static_assert(static_cast<int>(ProcessState::kWaiting) == process_t::WAITING);
static_assert(static_cast<int>(ProcessState::kStarting) == process_t::STARTING);
static_assert(static_cast<int>(ProcessState::kReady) == process_t::READY);
static_assert(static_cast<int>(ProcessState::kBackoff) == process_t::BACKOFF);
static_assert(static_cast<int>(ProcessState::kStopping) == process_t::STOPPING);
static_assert(static_cast<int>(ProcessState::kStopped) == process_t::STOPPED);
static_assert(static_cast<int>(ProcessState::kFailed) == process_t::FAILED);

process_t ToMessage(const ProcessReport& report) {
  process_t message{};
  message.name = report.name;
  message.state = static_cast<int>(report.state);
  message.pid = report.pid;
  message.restarts = report.restarts;
  message.last_exit_code = report.last_exit_code;
  message.uptime_s = report.uptime_s;
  message.watchdog_age_s = report.watchdog_age_s;
  message.backoff_s = report.backoff_s;
  message.rss_bytes = report.resident_bytes;
  message.status_text = report.status_text;
  return message;
}

/// Timers come a little early or late: what will be due within less than their period is due now.
constexpr Duration kJitter = std::chrono::milliseconds(100);

bool IsDue(std::optional<MonotonicTime> last, Duration period, MonotonicTime now) {
  return !last || now - *last >= period - kJitter;
}

}  // namespace

Result<void> SupervisorNode::Publish(MessageBus* bus,
                                     const std::vector<ProcessReport>& reports,
                                     std::int64_t changes,
                                     const ClockReading& now) {
  if (bus == nullptr) return {};
  const bool has_changed = changes != published_changes_;
  if (has_changed || IsDue(table_published_, kTablePeriod, now.monotonic)) {
    if (auto ok = PublishTable(*bus, reports, now); !ok) return ok;
    published_changes_ = changes;
  }
  if (IsDue(config_published_, kConfigPeriod, now.monotonic)) {
    if (auto ok = PublishConfig(*bus, now); !ok) return ok;
  }
  const auto last_timesync = timesync_published_
                                 ? std::optional<MonotonicTime>(timesync_published_->monotonic)
                                 : std::nullopt;
  if (!IsDue(last_timesync, kTimesyncPeriod, now.monotonic)) return {};
  return PublishTimesync(*bus, now);
}

void SupervisorNode::SetConfig(EffectiveConfig config) {
  config_ = std::move(config);
  config_published_.reset();
}

template <typename Message>
void SupervisorNode::Stamp(Message& message, std::int64_t seq, const ClockReading& now) const {
  message.utime = now.realtime_us;
  message.mono_ns = ToNanoseconds(now.monotonic);
  message.seq = seq;
  message.run_id = run_id_;
}

Result<void> SupervisorNode::PublishTable(MessageBus& bus,
                                          const std::vector<ProcessReport>& reports,
                                          const ClockReading& now) {
  supervisor_t message{};
  Stamp(message, table_seq_, now);
  for (const ProcessReport& report : reports)
    message.processes.push_back(ToMessage(report));
  message.n = static_cast<std::int32_t>(message.processes.size());
  if (auto ok = bus.Publish(channels::kSupervisor, message); !ok) return ok;
  ++table_seq_;
  table_published_ = now.monotonic;
  return {};
}

Result<void> SupervisorNode::PublishConfig(MessageBus& bus, const ClockReading& now) {
  config_t message{};
  Stamp(message, config_seq_, now);
  message.version = config_.version;
  message.hash = config_.hash;
  message.yaml = config_.yaml;
  if (auto ok = bus.Publish(channels::kConfig, message); !ok) return ok;
  ++config_seq_;
  config_published_ = now.monotonic;
  return {};
}

Result<void> SupervisorNode::PublishTimesync(MessageBus& bus, const ClockReading& now) {
  timesync_t message{};
  Stamp(message, timesync_seq_, now);
  if (timesync_published_) {
    const std::int64_t expected_us = timesync_published_->RealtimeUsAt(now.monotonic);
    message.step_ns = (now.realtime_us - expected_us) * 1000;
  }
  if (auto ok = bus.Publish(channels::kTimesync, message); !ok) return ok;
  ++timesync_seq_;
  timesync_published_ = now;
  return {};
}

std::string Summarize(const std::vector<ProcessReport>& reports) {
  const auto ready = std::count_if(reports.begin(), reports.end(), [](const auto& report) {
    return report.state == ProcessState::kReady;
  });
  std::string summary = fmt::format("{}/{} ready", ready, reports.size());
  for (const ProcessReport& report : reports) {
    if (report.state == ProcessState::kReady) continue;
    summary += fmt::format("; {} {}", report.name, NameOf(report.state));
    if (report.last_exit_code >= 0)
      summary += fmt::format(" (exit code {})", report.last_exit_code);
  }
  return summary;
}

bool IsEssentialReady(const std::vector<ProcessReport>& reports) {
  return std::all_of(reports.begin(), reports.end(), [](const ProcessReport& report) {
    const bool is_essential = report.name == "odometryd" || report.name == "smootherd";
    return !is_essential || report.state == ProcessState::kReady ||
           report.state == ProcessState::kFailed;
  });
}

}  // namespace relocd
