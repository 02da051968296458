#include "messaging/node_status.h"

#include <fmt/format.h>

namespace relocd {

void NodeStatus::Raise(int new_level, const std::string& why) {
  if (new_level <= level) return;
  level = new_level;
  message = why;
}

void AddChannelCounters(const MessageBus& bus, NodeStatus& status) {
  const auto add = [&status](const std::string& channel, const char* what, std::int64_t count) {
    status.Add(fmt::format("{}_{}", channel, what), static_cast<double>(count));
  };
  for (const auto& [channel, counters] : bus.counters()) {
    add(channel, "received", counters.received);
    add(channel, "undecodable", counters.undecodable);
    add(channel, "superseded", counters.superseded);
    add(channel, "lost", counters.stream.lost);
    add(channel, "repeated", counters.stream.repeated);
    add(channel, "restarts", counters.stream.restarts);
    add(channel, "conflicts", counters.stream.conflicts);
    if (counters.stream.conflicts > 0) {
      status.Raise(
          status_t::WARNING,
          fmt::format("two processes publish on {}: {} messages of a run that another had followed",
                      channel,
                      counters.stream.conflicts));
    }
  }
}

}  // namespace relocd
