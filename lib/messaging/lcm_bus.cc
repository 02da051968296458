#include "messaging/lcm_bus.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <chrono>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "core/time.h"
#include "core/unique_fd.h"

namespace relocd {
namespace {

/// LCM's own default of 30 drops what comes while a daemon works on one image.
constexpr int kQueueCapacity = 1024;
/// So that messages that come as fast as they are handled do not keep an event loop from its other
/// inputs, and the watchdog from a sign of life.
constexpr Duration kLongestTurn = std::chrono::milliseconds(100);

/// Whether a datagram to the url's multicast group would find a way out. LCM itself only prints
/// "connect: ...".
Result<void> CheckMulticastRoute(const std::string& url) {
  constexpr std::string_view kScheme = "udpm://";
  const std::string host =
      url.substr(kScheme.size(), url.find_first_of(":?", kScheme.size()) - kScheme.size());
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(9);  // any port: nothing is sent
  if (::inet_pton(AF_INET, host.c_str(), &address.sin_addr) != 1) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("opening LCM at '{}': '{}' is no IPv4 address, must be as in "
                             "udpm://239.255.76.67:7667?ttl=0",
                             url,
                             host)};
  }
  const UniqueFd fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0)
    return {};
  return Error{
      ErrorKind::kUnavailable,
      fmt::format(
          "opening LCM at '{}': no multicast route ({}), add one with: ip link set lo up && "
          "ip route add 239.255.76.0/24 dev lo",
          url,
          std::generic_category().message(errno))};
}

}  // namespace

Result<std::unique_ptr<LcmBus>> LcmBus::Open(const std::string& url) {
  if (url.starts_with("udpm://")) {
    if (auto ok = CheckMulticastRoute(url); !ok) return std::move(ok).error();
  }
  lcm_t* lcm = ::lcm_create(url.c_str());
  if (lcm == nullptr) {
    return Error{
        ErrorKind::kUnavailable,
        fmt::format("opening LCM at '{}': refused, must be a udpm://, memq:// or file:// url "
                    "that can be opened",
                    url)};
  }
  return std::unique_ptr<LcmBus>(new LcmBus(lcm, url));
}

LcmBus::~LcmBus() {
  ::lcm_destroy(lcm_);
}

Result<void> LcmBus::PublishBytes(const std::string& channel, std::span<const std::uint8_t> bytes) {
  if (::lcm_publish(lcm_, channel.c_str(), bytes.data(), static_cast<unsigned int>(bytes.size())) !=
      0) {
    return Error{ErrorKind::kUnavailable,
                 fmt::format("publishing {} bytes on {}: {}",
                             bytes.size(),
                             channel,
                             std::generic_category().message(errno))};
  }
  return {};
}

void LcmBus::OnSubscribe(Subscription& subscription) {
  lcm_subscription_t* handle =
      ::lcm_subscribe(lcm_, subscription.pattern.c_str(), &LcmBus::OnMessage, &subscription);
  if (handle == nullptr) {
    is_deaf_ = true;
    return;
  }
  ::lcm_subscription_set_queue_capacity(handle, kQueueCapacity);
}

Result<void> LcmBus::CheckListening() const {
  if (!is_deaf_) return {};
  return Error{ErrorKind::kUnavailable,
               fmt::format("listening at '{}': LCM cannot, and says why above: its port must not "
                           "be another program's alone (ss -ulpn), and no firewall may keep "
                           "multicast from lo",
                           url_)};
}

void LcmBus::OnMessage(const lcm_recv_buf_t* buffer, const char* channel, void* user) noexcept {
  static_cast<Subscription*>(user)->Take(
      channel, {static_cast<const std::uint8_t*>(buffer->data), buffer->data_size});
}

int LcmBus::HandlePending() {
  const MonotonicTime end = MonotonicClock::now() + kLongestTurn;
  int handled = 0;
  while (::lcm_handle_timeout(lcm_, 0) > 0) {
    ++handled;
    if (MonotonicClock::now() >= end) break;
  }
  HandOnNewest();
  return handled;
}

int LcmBus::fd() const {
  return ::lcm_get_fileno(lcm_);
}

}  // namespace relocd
