#include "messaging/message_bus.h"

#include "messaging/image_metadata.h"

namespace relocd {

class MessageBus::RawSubscription final : public Subscription {
 public:
  explicit RawSubscription(RawHandler handler) : handler_(std::move(handler)) {}

  void Take(const std::string& channel, std::span<const std::uint8_t> bytes) override {
    ++counters.received;
    handler_(channel, bytes);
  }
  void HandOn() override {}

 private:
  RawHandler handler_;
};

std::optional<StreamPosition> PositionOf(const image_t& message) {
  const auto metadata = FindImageMetadata(message);
  if (!metadata) return std::nullopt;
  return StreamPosition{.seq = metadata->seq, .run_id = metadata->run_id};
}

MessageBus::~MessageBus() = default;

void MessageBus::SubscribeRaw(const std::string& pattern, RawHandler handler) {
  AddSubscription(pattern, std::make_unique<RawSubscription>(std::move(handler)));
}

void MessageBus::AddSubscription(const std::string& pattern,
                                 std::unique_ptr<Subscription> subscription) {
  subscription->pattern = pattern;
  subscriptions_.push_back(std::move(subscription));
  OnSubscribe(*subscriptions_.back());
}

void MessageBus::HandOnNewest() {
  for (const auto& subscription : subscriptions_)
    subscription->HandOn();
}

std::map<std::string, ChannelCounters> MessageBus::counters() const {
  std::map<std::string, ChannelCounters> counters;
  for (const auto& subscription : subscriptions_) {
    counters[subscription->pattern] = subscription->counters;
  }
  return counters;
}

bool MessageBus::Matches(const std::string& pattern, const std::string& channel) {
  constexpr std::string_view kAnything = ".*";
  if (!pattern.ends_with(kAnything)) return pattern == channel;
  const std::string_view all = pattern;
  return channel.starts_with(all.substr(0, all.size() - kAnything.size()));
}

}  // namespace relocd
