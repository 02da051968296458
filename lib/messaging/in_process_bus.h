#pragma once

#include <deque>
#include <string>
#include <vector>

#include "messaging/message_bus.h"

namespace relocd {

/// A bus within one thread that delivers in the order of publication, and depends on nothing else:
/// two runs with the same input are the same.
class InProcessBus final : public MessageBus {
 public:
  Result<void> PublishBytes(const std::string& channel,
                            std::span<const std::uint8_t> bytes) override;

  /// Delivers until nothing waits, which includes what the handlers publish meanwhile.
  int HandlePending() override;

  [[nodiscard]] int fd() const override { return -1; }

 protected:
  void OnSubscribe(Subscription& /*subscription*/) override {}

 private:
  struct Event {
    std::string channel;
    std::vector<std::uint8_t> bytes;
  };
  void HandOnFirst();

  std::deque<Event> events_;
};

}  // namespace relocd
