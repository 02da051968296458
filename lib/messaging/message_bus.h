#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "messaging/bounded_decode.h"
#include "messaging/channels.h"
#include "messaging/stream_monitor.h"

namespace relocd {

/// Which of the messages that wait a subscriber is handed.
enum class Delivery {
  kEvery,   ///< All, in the order they came.
  kNewest,  ///< The last one: what is older is counted as superseded. For work that takes longer
            ///< than a message's period.
};

/// What came on a channel that this bus subscribed to.
struct ChannelCounters {
  std::int64_t received = 0;
  std::int64_t undecodable = 0;  ///< Not a message of the channel's type, or over its limits.
  std::int64_t superseded = 0;   ///< Not handed on, since a newer one waited behind it.
  StreamMonitor::Counters stream;
};

/// Where in its publisher's stream a message stands; nothing for the types that do not say.
template <typename Message>
std::optional<StreamPosition> PositionOf(const Message& message) {
  if constexpr (requires {
                  message.seq;
                  message.run_id;
                }) {
    return StreamPosition{.seq = message.seq, .run_id = message.run_id};
  } else {
    return std::nullopt;
  }
}
std::optional<StreamPosition> PositionOf(const image_t& message);  // in its metadata

/// Publishes and subscribes to typed messages. The back ends are LcmBus (between processes, within
/// one, or a log file) and InProcessBus (deterministic, for the exact replay and for tests).
///
/// Thread-bound: created, used and destroyed on one thread, which also runs the handlers, from
/// within HandlePending. Handlers may publish, and must not subscribe or throw.
class MessageBus {
 public:
  using RawHandler =
      std::function<void(const std::string& channel, std::span<const std::uint8_t> bytes)>;

  virtual ~MessageBus();
  MessageBus(const MessageBus&) = delete;
  MessageBus& operator=(const MessageBus&) = delete;
  MessageBus(MessageBus&&) = delete;
  MessageBus& operator=(MessageBus&&) = delete;

  /// @return kUnavailable when the network is not there.
  template <typename Message>
  Result<void> Publish(const Channel<Message>& channel, const Message& message) {
    encoded_.resize(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(encoded_.data(), 0, static_cast<int>(encoded_.size()));
    return PublishBytes(channel.name, encoded_);
  }
  virtual Result<void> PublishBytes(const std::string& channel,
                                    std::span<const std::uint8_t> bytes) = 0;

  /// Hands decoded messages to `handler` until this bus is destroyed. What does not decode is
  /// counted and dropped.
  template <typename Message>
  void Subscribe(const Channel<Message>& channel,
                 Delivery delivery,
                 std::function<void(const Message&)> handler) {
    AddSubscription(channel.name,
                    std::make_unique<TypedSubscription<Message>>(delivery, std::move(handler)));
  }

  /// Hands every message's bytes to `handler`, undecoded and unchecked.
  ///
  /// @param pattern  a channel's name, or a prefix followed by `.*`.
  void SubscribeRaw(const std::string& pattern, RawHandler handler);

  /// Hands on the messages that wait, and does not block. What comes as fast as it is handled may
  /// be left for the next call. @return how many were handed on.
  virtual int HandlePending() = 0;

  /// To be watched for readability by an event loop; -1 for a bus that has no use of it.
  [[nodiscard]] virtual int fd() const = 0;

  /// Whether anything is subscribed to, so that fd() is worth watching: with LCM, asking for it
  /// starts a thread that takes in every message of the network.
  [[nodiscard]] bool is_listening() const { return !subscriptions_.empty(); }

  /// By the name or pattern subscribed to.
  [[nodiscard]] std::map<std::string, ChannelCounters> counters() const;

 protected:
  /// One subscriber: takes bytes in, and hands on.
  class Subscription {
   public:
    Subscription() = default;
    virtual ~Subscription() = default;
    Subscription(const Subscription&) = delete;
    Subscription& operator=(const Subscription&) = delete;
    Subscription(Subscription&&) = delete;
    Subscription& operator=(Subscription&&) = delete;

    virtual void Take(const std::string& channel, std::span<const std::uint8_t> bytes) = 0;
    /// Called when nothing more waits.
    virtual void HandOn() = 0;

    ChannelCounters counters;
    std::string pattern;
  };

  MessageBus() = default;

  /// Called once for each subscription; it lives as long as this.
  virtual void OnSubscribe(Subscription& subscription) = 0;

  /// Called by a back end at the end of HandlePending.
  void HandOnNewest();

  static bool Matches(const std::string& pattern, const std::string& channel);

  [[nodiscard]] const std::vector<std::unique_ptr<Subscription>>& subscriptions() const {
    return subscriptions_;
  }

 private:
  template <typename Message>
  class TypedSubscription final : public Subscription {
   public:
    TypedSubscription(Delivery delivery, std::function<void(const Message&)> handler)
        : delivery_(delivery), handler_(std::move(handler)) {}

    void Take(const std::string& /*channel*/, std::span<const std::uint8_t> bytes) override {
      ++this->counters.received;
      auto message = DecodeBounded<Message>(bytes);
      if (!message) {
        ++this->counters.undecodable;
        return;
      }
      if (const auto position = PositionOf(*message)) {
        monitor_.Observe(*position);
        this->counters.stream = monitor_.counters();
      }
      if (delivery_ == Delivery::kEvery) {
        handler_(*message);
        return;
      }
      if (newest_) ++this->counters.superseded;
      newest_ = std::move(message);
    }

    void HandOn() override {
      if (!newest_) return;
      const Message message = *std::exchange(newest_, std::nullopt);
      handler_(message);
    }

   private:
    Delivery delivery_;
    std::function<void(const Message&)> handler_;
    std::optional<Message> newest_;
    StreamMonitor monitor_;
  };
  class RawSubscription;

  void AddSubscription(const std::string& pattern, std::unique_ptr<Subscription> subscription);

  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::vector<std::uint8_t>
      encoded_;  ///< Kept between calls, so that publishing does not allocate.
};

}  // namespace relocd
