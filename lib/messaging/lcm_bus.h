#pragma once

#include <memory>
#include <string>
#include <utility>

#include <lcm/lcm.h>

#include "messaging/message_bus.h"

namespace relocd {

/// A bus over LCM, chosen by the url:
///   `udpm://239.255.76.67:7667?ttl=0`  between the processes of one machine, by multicast;
///   `memq://`                          within one process, as in tests;
///   `file:///path/x.lcmlog?mode=w`     into a log file, and with `?speed=0` out of one.
class LcmBus final : public MessageBus {
 public:
  /// Blocked signals stay blocked in the thread that LCM starts: create the EventLoop first.
  ///
  /// @return kUnavailable; where the multicast route is missing, with the command that adds it.
  static Result<std::unique_ptr<LcmBus>> Open(const std::string& url);

  ~LcmBus() override;
  LcmBus(const LcmBus&) = delete;
  LcmBus& operator=(const LcmBus&) = delete;
  LcmBus(LcmBus&&) = delete;
  LcmBus& operator=(LcmBus&&) = delete;

  Result<void> PublishBytes(const std::string& channel,
                            std::span<const std::uint8_t> bytes) override;
  int HandlePending() override;
  [[nodiscard]] int fd() const override;

  /// To be asked after subscribing: LCM begins to listen with the first subscription.
  ///
  /// @return kUnavailable when it could not.
  [[nodiscard]] Result<void> CheckListening() const;

 protected:
  void OnSubscribe(Subscription& subscription) override;

 private:
  LcmBus(lcm_t* lcm, std::string url) : lcm_(lcm), url_(std::move(url)) {}

  static void OnMessage(const lcm_recv_buf_t* buffer, const char* channel, void* user) noexcept;

  lcm_t* lcm_;
  std::string url_;
  bool is_deaf_ = false;  ///< LCM refused a subscription.
};

}  // namespace relocd
