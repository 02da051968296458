#include "status_report.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "messaging/bounded_decode.h"
#include "messaging/channels.h"
#include "supervision/restart_policy.h"

namespace relocd {
namespace {

/// Ten odometry periods at 10 Hz: an older pose does not say where the robot is now.
constexpr double kStaleAfter = 1.0;

double Degrees(double radians) {
  return radians * 180.0 / std::numbers::pi;
}

std::string NameOfProcessState(int state) {
  return std::string(NameOf(static_cast<ProcessState>(state)));
}

const char* NameOfLevel(int level) {
  return level == status_t::OK ? "OK" : level == status_t::WARNING ? "WARNING" : "ERROR";
}

std::string Uptime(double seconds) {
  const auto whole = static_cast<std::int64_t>(seconds);
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min", whole / 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

double AgeSeconds(const localization_t& localization, MonotonicTime now) {
  return ToSeconds(now - FromNanoseconds(localization.mono_ns));
}

/// The longer half axis of the position's one-sigma ellipse.
double PositionSigma(const localization_t& localization) {
  const double xx = localization.covariance[0];
  const double xy = localization.covariance[1];
  const double yy = localization.covariance[4];
  const double spread = std::hypot(0.5 * (xx - yy), xy);
  return std::sqrt(std::max(0.5 * (xx + yy) + spread, 0.0));
}

double HeadingSigma(const localization_t& localization) {
  return std::sqrt(std::max(localization.covariance[8], 0.0));
}

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < ' ') {
      quoted += fmt::format("\\u{:04x}", static_cast<int>(c));
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

/// JSON has no NaN.
std::string Number(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : "null";
}

std::string JsonOf(const process_t& process) {
  return fmt::format(
      R"({{"name": {}, "state": {}, "pid": {}, "restarts": {}, "last_exit_code": {}, )"
      R"("uptime_s": {}, "watchdog_age_s": {}, "backoff_s": {}, "rss_bytes": {}, "status": {}}})",
      Quoted(process.name),
      Quoted(NameOfProcessState(process.state)),
      process.pid,
      process.restarts,
      process.last_exit_code,
      Number(process.uptime_s),
      Number(process.watchdog_age_s),
      Number(process.backoff_s),
      process.rss_bytes,
      Quoted(process.status_text));
}

std::string JsonOf(const status_t& status) {
  std::vector<std::string> values;
  for (const status_value_t& value : status.values)
    values.push_back(fmt::format("{}: {}", Quoted(value.name), Number(value.value)));
  return fmt::format(R"({{"daemon": {}, "level": {}, "message": {}, "version": {}, )"
                     R"("config_hash": {}, "values": {{{}}}}})",
                     Quoted(status.daemon),
                     Quoted(NameOfLevel(status.level)),
                     Quoted(status.message),
                     Quoted(status.version),
                     Quoted(status.config_hash),
                     fmt::join(values, ", "));
}

std::string JsonOf(const localization_t& localization, double rate_hz, MonotonicTime now) {
  return fmt::format(R"({{"status": {}, "message": {}, "x_WB_m": {}, "y_WB_m": {}, )"
                     R"("yaw_WB_rad": {}, "sigma_position_m": {}, "sigma_yaw_rad": {}, )"
                     R"("age_s": {}, "rate_hz": {}, "time_since_fix_s": {}, )"
                     R"("fixes_accepted": {}, "fixes_rejected": {}}})",
                     Quoted(NameOfLocalizationStatus(localization.status)),
                     Quoted(localization.message),
                     Number(localization.x_WB_m),
                     Number(localization.y_WB_m),
                     Number(localization.yaw_WB_rad),
                     Number(PositionSigma(localization)),
                     Number(HeadingSigma(localization)),
                     Number(AgeSeconds(localization, now)),
                     Number(rate_hz),
                     Number(localization.time_since_fix_s),
                     localization.fixes_accepted,
                     localization.fixes_rejected);
}

std::string RowOf(const process_t& process) {
  return fmt::format("{:<20} {:<9} {:>7} {:>10} {:>8} {:>6.0f} MB  {}\n",
                     process.name,
                     NameOfProcessState(process.state),
                     process.pid,
                     Uptime(process.uptime_s),
                     process.restarts,
                     static_cast<double>(process.rss_bytes) * 1e-6,
                     process.status_text);
}

std::string TextOf(const localization_t& localization, double rate_hz, MonotonicTime now) {
  return fmt::format(
      "localization {}: x {:.2f} m, y {:.2f} m, heading {:.1f} deg; sigma {:.2f} m, {:.1f} deg; "
      "age {:.0f} ms; {:.1f} Hz; {} fixes, {} rejected{}{}\n",
      NameOfLocalizationStatus(localization.status),
      localization.x_WB_m,
      localization.y_WB_m,
      Degrees(localization.yaw_WB_rad),
      PositionSigma(localization),
      Degrees(HeadingSigma(localization)),
      AgeSeconds(localization, now) * 1e3,
      rate_hz,
      localization.fixes_accepted,
      localization.fixes_rejected,
      localization.message.empty() ? "" : ": ",
      localization.message);
}

std::string ProblemOf(const process_t& process) {
  std::string problem = fmt::format("{} is {}", process.name, NameOfProcessState(process.state));
  if (process.last_exit_code > 128) {
    problem += fmt::format(" (ended by signal {})", process.last_exit_code - 128);
  } else if (process.last_exit_code >= 0) {
    problem += fmt::format(" (ended with exit code {})", process.last_exit_code);
  }
  const bool has_failed = process.state == process_t::FAILED;
  if (!process.status_text.empty()) {
    problem += ": " + process.status_text;
  } else if (has_failed) {
    problem += ": its input is wrong, see journalctl -u relocd";
  }
  if (has_failed) problem += "; mend it, then systemctl reload relocd";
  return problem;
}

}  // namespace

std::string NameOfLocalizationStatus(int status) {
  switch (status) {
    case localization_t::UNINITIALISED:
      return "UNINITIALISED";
    case localization_t::CONVERGING:
      return "CONVERGING";
    case localization_t::OK:
      return "OK";
    case localization_t::DEAD_RECKONING:
      return "DEAD_RECKONING";
    case localization_t::LOST:
      return "LOST";
    case localization_t::FAULT:
      return "FAULT";
    default:
      return fmt::format("UNKNOWN ({})", status);
  }
}

void StatusReport::Subscribe(MessageBus& bus) {
  bus.Subscribe<supervisor_t>(
      channels::kSupervisor, Delivery::kEvery, [this](const auto& message) { Handle(message); });
  bus.Subscribe<localization_t>(
      channels::kLocalization, Delivery::kEvery, [this](const auto& message) { Handle(message); });
  bus.SubscribeRaw(StatusChannel(".*").name,
                   [this](const std::string& /*channel*/, std::span<const std::uint8_t> bytes) {
                     if (const auto message = DecodeBounded<status_t>(bytes)) Handle(*message);
                   });
}

void StatusReport::Handle(const localization_t& message) {
  if (localizations_ == 0) first_localization_ns_ = message.mono_ns;
  ++localizations_;
  localization_ = message;
}

bool StatusReport::HasHeardNothing() const {
  return !table_ && statuses_.empty() && !localization_;
}

/// Where there is no table, the daemons were started by hand: whoever does so wants a pose.
bool StatusReport::ExpectsLocalization() const {
  if (!table_) return true;
  return std::any_of(table_->processes.begin(),
                     table_->processes.end(),
                     [](const process_t& process) { return process.name == "smootherd"; });
}

double StatusReport::LocalizationRate() const {
  if (localizations_ < 2) return 0.0;
  const Duration span(localization_->mono_ns - first_localization_ns_);
  return span > Duration::zero() ? static_cast<double>(localizations_ - 1) / ToSeconds(span) : 0.0;
}

std::vector<std::string> StatusReport::Problems(MonotonicTime now) const {
  if (HasHeardNothing()) {
    return {
        "nothing was heard: start relocd (systemctl start relocd, or relocd --config FILE), or "
        "give the --lcm-url that it uses"};
  }
  std::vector<std::string> problems;
  if (!table_) {
    problems.emplace_back(
        "no SUPERVISOR message was heard: relocd does not run, so nobody restarts "
        "the daemons (systemctl start relocd)");
  } else {
    for (const process_t& process : table_->processes) {
      if (process.state != process_t::READY) problems.push_back(ProblemOf(process));
    }
  }
  for (const auto& [daemon, status] : statuses_) {
    if (status.level == status_t::OK) continue;
    problems.push_back(
        fmt::format("{}: {}: {}", daemon, NameOfLevel(status.level), status.message));
  }
  if (!localization_) {
    if (ExpectsLocalization()) {
      problems.emplace_back(
          "no LOCALIZATION message was heard: smootherd publishes one for each "
          "ODOMETRY message, so see odometryd's and smootherd's state");
    }
    return problems;
  }
  if (localization_->status != localization_t::OK) {
    problems.push_back(fmt::format("localization is {}{}{}",
                                   NameOfLocalizationStatus(localization_->status),
                                   localization_->message.empty() ? "" : ": ",
                                   localization_->message));
  }
  if (const double age_s = AgeSeconds(*localization_, now); age_s > kStaleAfter) {
    problems.push_back(fmt::format("the pose is {:.1f} s old, may be {} s", age_s, kStaleAfter));
  }
  return problems;
}

std::string StatusReport::Text(MonotonicTime now) const {
  std::string text;
  if (table_) {
    text += fmt::format("{:<20} {:<9} {:>7} {:>10} {:>8} {:>9}  {}\n",
                        "process",
                        "state",
                        "pid",
                        "up",
                        "restarts",
                        "memory",
                        "status");
    for (const process_t& process : table_->processes)
      text += RowOf(process);
  } else {
    for (const auto& [daemon, status] : statuses_)
      text += fmt::format("{:<20} {:<9} {}\n", daemon, NameOfLevel(status.level), status.message);
  }
  if (localization_) text += TextOf(*localization_, LocalizationRate(), now);
  return text;
}

std::string StatusReport::Json(MonotonicTime now) const {
  std::vector<std::string> problems;
  for (const std::string& problem : Problems(now))
    problems.push_back(Quoted(problem));
  std::vector<std::string> processes;
  if (table_) {
    for (const process_t& process : table_->processes)
      processes.push_back(JsonOf(process));
  }
  std::vector<std::string> statuses;
  for (const auto& [daemon, status] : statuses_)
    statuses.push_back(JsonOf(status));
  return fmt::format(
      R"({{"ok": {}, "problems": [{}], "processes": [{}], "daemons": [{}], "localization": {}}})"
      "\n",
      problems.empty(),
      fmt::join(problems, ", "),
      fmt::join(processes, ", "),
      fmt::join(statuses, ", "),
      localization_ ? JsonOf(*localization_, LocalizationRate(), now) : "null");
}

}  // namespace relocd
