#include "messaging/in_process_bus.h"

namespace relocd {

Result<void> InProcessBus::PublishBytes(const std::string& channel,
                                        std::span<const std::uint8_t> bytes) {
  events_.push_back({.channel = channel, .bytes = {bytes.begin(), bytes.end()}});
  return {};
}

int InProcessBus::HandlePending() {
  int handled = 0;
  while (!events_.empty()) {
    for (; !events_.empty(); ++handled)
      HandOnFirst();
    HandOnNewest();
  }
  return handled;
}

void InProcessBus::HandOnFirst() {
  const Event event = std::move(events_.front());
  events_.pop_front();
  for (const auto& subscription : subscriptions()) {
    if (Matches(subscription->pattern, event.channel)) {
      subscription->Take(event.channel, event.bytes);
    }
  }
}

}  // namespace relocd
