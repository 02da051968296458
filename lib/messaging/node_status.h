#pragma once

#include <string>
#include <vector>

#include "relocd/status_t.hpp"

#include "messaging/message_bus.h"

namespace relocd {

/// One number of a daemon's STATUS: the name carries the unit, as in `image_age_p99_ms`.
struct StatusValue {
  std::string name;
  double value = 0.0;
};

/// How a node is: what STATUS_<daemon> says once a second.
struct NodeStatus {
  int level = status_t::OK;  ///< status_t::OK, WARNING or ERROR.
  std::string message;       ///< What is wrong, with the number that shows it; empty when OK.
  std::vector<StatusValue> values;

  void Add(std::string name, double value) { values.push_back({std::move(name), value}); }

  /// Raises the level, never lowers it; the first message of the highest level stays.
  void Raise(int new_level, const std::string& why);
};

/// Adds what a bus counted on each channel that it subscribed to, and raises the level where two
/// publish on one channel.
void AddChannelCounters(const MessageBus& bus, NodeStatus& status);

}  // namespace relocd
