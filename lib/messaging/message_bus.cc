#include "messaging/message_bus.h"

#include <string_view>

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

namespace {

std::optional<std::int64_t> FindInt64(const image_t& message, std::string_view key) {
  for (const image_metadata_t& metadata : message.metadata) {
    if (metadata.key != key || metadata.value.size() != sizeof(std::int64_t)) continue;
    std::uint64_t value = 0;
    for (const std::uint8_t byte : metadata.value)
      value = value << 8 | byte;
    return static_cast<std::int64_t>(value);
  }
  return std::nullopt;
}

}  // namespace

std::optional<StreamPosition> PositionOf(const image_t& message) {
  const auto seq = FindInt64(message, "seq");
  const auto run_id = FindInt64(message, "run_id");
  if (!seq || !run_id) return std::nullopt;
  return StreamPosition{.seq = *seq, .run_id = *run_id};
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
  return channel.starts_with(
      std::string_view(pattern).substr(0, pattern.size() - kAnything.size()));
}

}  // namespace relocd
