#include "log_summary.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include <fmt/format.h>

#include "messaging/message_bus.h"

namespace relocd {
namespace {

struct Heading {
  std::optional<StreamPosition> position;
  std::int64_t utime = 0;
};

template <typename Message>
std::optional<Heading> HeadingAs(const LogEvent& event) {
  const auto message = DecodeBounded<Message>(event.data);
  if (!message) return std::nullopt;
  return Heading{.position = PositionOf(*message), .utime = message->utime};
}

template <typename... Messages>
std::optional<Heading> HeadingAsAnyOf(const LogEvent& event) {
  std::optional<Heading> heading;
  static_cast<void>(((heading = HeadingAs<Messages>(event)) || ...));
  return heading;
}

/// The fingerprint tells the type; a channel of another program gives nothing.
std::optional<Heading> HeadingOf(const LogEvent& event) {
  return HeadingAsAnyOf<odometry_t,
                        pose_t,
                        localization_t,
                        camera_pose_t,
                        image_t,
                        can_frames_t,
                        rigid_transform_t,
                        status_t,
                        supervisor_t,
                        timesync_t,
                        config_t,
                        text_t>(event);
}

double Percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  const auto rank = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

/// Not in integers: the times are what a message says, and their difference may need 65 bits.
double Difference(std::int64_t later, std::int64_t earlier) {
  return static_cast<double>(later) - static_cast<double>(earlier);
}

constexpr double kUsPerMs = 1e3;
constexpr double kUsPerS = 1e6;

}  // namespace

void LogSummary::Add(const LogEvent& event) {
  ChannelSummary& channel = channels_[event.channel];
  if (channel.events == 0) channel.first_us = event.timestamp_us;
  ++channel.events;
  channel.bytes += static_cast<std::int64_t>(event.data.size());
  channel.last_us = event.timestamp_us;
  const auto heading = HeadingOf(event);
  if (!heading) return;
  if (heading->position) channel.monitor.Observe(*heading->position);
  channel.ages_us.push_back(Difference(event.timestamp_us, heading->utime));
}

std::int64_t LogSummary::Events(const std::string& channel) const {
  const auto found = channels_.find(channel);
  return found == channels_.end() ? 0 : found->second.events;
}

std::int64_t LogSummary::Lost() const {
  std::int64_t lost = 0;
  for (const auto& [name, channel] : channels_)
    lost += channel.monitor.counters().lost;
  return lost;
}

double LogSummary::AgePercentileMs(const std::string& channel, double share) const {
  const auto found = channels_.find(channel);
  return found == channels_.end() ? std::nan("")
                                  : Percentile(found->second.ages_us, share) / kUsPerMs;
}

std::string LogSummary::FormatTable(const LogReader::Counters& counters) const {
  std::string text = fmt::format("{:<24} {:>8} {:>8} {:>9} {:>6} {:>9} {:>9} {:>9}\n",
                                 "channel",
                                 "events",
                                 "Hz",
                                 "kB/s",
                                 "lost",
                                 "p50 ms",
                                 "p99 ms",
                                 "max ms");
  for (const auto& [name, channel] : channels_) {
    const double seconds = std::max(Difference(channel.last_us, channel.first_us) / kUsPerS, 1e-6);
    const double intervals = static_cast<double>(std::max<std::int64_t>(channel.events - 1, 0));
    fmt::format_to(std::back_inserter(text),
                   "{:<24} {:>8} {:>8.2f} {:>9.1f} {:>6} {:>9.2f} {:>9.2f} {:>9.2f}\n",
                   name,
                   channel.events,
                   intervals / seconds,
                   static_cast<double>(channel.bytes) / seconds / 1e3,
                   channel.monitor.counters().lost,
                   Percentile(channel.ages_us, 0.5) / kUsPerMs,
                   Percentile(channel.ages_us, 0.99) / kUsPerMs,
                   Percentile(channel.ages_us, 1.0) / kUsPerMs);
  }
  fmt::format_to(std::back_inserter(text),
                 "(ms: from the measurement to its arrival at the recorder)\n{} events, {} damaged "
                 "places, {} bytes skipped\n",
                 counters.events,
                 counters.damaged_places,
                 counters.skipped_bytes);
  return text;
}

std::string LogSummary::FormatJson(const LogReader::Counters& counters) const {
  std::string text = "{\"channels\":{";
  const char* separator = "";
  for (const auto& [name, channel] : channels_) {
    const auto& stream = channel.monitor.counters();
    fmt::format_to(
        std::back_inserter(text),
        "{}\"{}\":{{\"events\":{},\"bytes\":{},\"first_us\":{},\"last_us\":{},\"lost\":{},"
        "\"repeated\":{},\"restarts\":{}",
        separator,
        name,
        channel.events,
        channel.bytes,
        channel.first_us,
        channel.last_us,
        stream.lost,
        stream.repeated,
        stream.restarts);
    if (!channel.ages_us.empty()) {
      fmt::format_to(std::back_inserter(text),
                     ",\"age_p50_ms\":{},\"age_p99_ms\":{},\"age_max_ms\":{}",
                     Percentile(channel.ages_us, 0.5) / kUsPerMs,
                     Percentile(channel.ages_us, 0.99) / kUsPerMs,
                     Percentile(channel.ages_us, 1.0) / kUsPerMs);
    }
    text += "}";
    separator = ",";
  }
  fmt::format_to(std::back_inserter(text),
                 "}},\"events\":{},\"damaged_places\":{},\"skipped_bytes\":{}}}\n",
                 counters.events,
                 counters.damaged_places,
                 counters.skipped_bytes);
  return text;
}

}  // namespace relocd
