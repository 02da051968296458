#include "smoother_command.h"

#include <poll.h>

#include <chrono>

#include "core/time.h"
#include "messaging/lcm_bus.h"

namespace relocd {

Result<void> CommandSmoother(const std::string& lcm_url,
                             const std::function<Result<void>(MessageBus&)>& publish,
                             const std::function<bool(const localization_t&)>& is_done) {
  constexpr Duration kPatience = std::chrono::seconds(2);
  auto bus = LcmBus::Open(lcm_url);
  if (!bus) return std::move(bus).error();
  bool is_there = false;
  bool is_asked = false;
  bool is_answered = false;
  (*bus)->Subscribe<localization_t>(
      channels::kLocalization, Delivery::kEvery, [&](const localization_t& message) {
        is_there = true;
        is_answered = is_answered || (is_asked && is_done(message));
      });
  const MonotonicTime end = MonotonicClock::now() + kPatience;
  for (MonotonicTime now = MonotonicClock::now(); now < end; now = MonotonicClock::now()) {
    // First the messages of before, so that a change is seen as one.
    if (is_there && !is_asked) {
      is_asked = true;
      if (auto ok = publish(**bus); !ok) return ok;
    }
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - now);
    pollfd ready{.fd = (*bus)->fd(), .events = POLLIN, .revents = 0};
    ::poll(&ready, 1, static_cast<int>(left.count()) + 1);
    (*bus)->HandlePending();
    if (is_answered) return {};
  }
  return Error{ErrorKind::kUnavailable,
               is_there ? "smootherd has not done it within 2 s: see reloc status"
                        : "no LOCALIZATION within 2 s: do smootherd and odometryd run?"};
}

}  // namespace relocd
