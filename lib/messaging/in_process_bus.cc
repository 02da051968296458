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
    while (!events_.empty()) {
      const Event event = std::move(events_.front());
      events_.pop_front();
      ++handled;
      for (const auto& subscription : subscriptions()) {
        if (Matches(subscription->pattern, event.channel)) {
          subscription->Take(event.channel, event.bytes);
        }
      }
    }
    HandOnNewest();
  }
  return handled;
}

}  // namespace relocd
