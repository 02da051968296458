#include "camerad/source_waiter.h"

#include <errno.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/file.h"

namespace relocd {
namespace {

/// Adding what is watched already is no error: a device that was closed has left by itself, and
/// another may have its number.
Result<void> Watch(int epoll, int fd) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = fd;
  if (::epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event) == 0 || errno == EEXIST) return {};
  return SystemError(ErrorKind::kInternal, "watching the camera");
}

}  // namespace

Result<SourceWaiter> SourceWaiter::Create() {
  UniqueFd epoll(::epoll_create1(EPOLL_CLOEXEC));
  if (!epoll.valid()) return SystemError(ErrorKind::kInternal, "creating an epoll instance");
  UniqueFd timer(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
  if (!timer.valid()) return SystemError(ErrorKind::kInternal, "creating a timer");
  if (auto ok = Watch(epoll.get(), timer.get()); !ok) return std::move(ok).error();
  return SourceWaiter(std::move(epoll), std::move(timer));
}

Result<void> SourceWaiter::Follow(const FrameSource& source) {
  if (source.fd() >= 0) {
    if (auto ok = Watch(epoll_.get(), source.fd()); !ok) return ok;
  }
  itimerspec spec{};  // zeros disarm, and arming takes back what has expired
  if (source.NextWakeUp() != MonotonicTime::max()) {
    const Duration least = std::chrono::nanoseconds(1);
    const Duration since_boot = std::max(least, source.NextWakeUp().time_since_epoch());
    spec.it_value.tv_sec = since_boot / std::chrono::seconds(1);
    spec.it_value.tv_nsec = (since_boot % std::chrono::seconds(1)).count();
  }
  if (::timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &spec, nullptr) == 0) return {};
  return SystemError(ErrorKind::kInternal, "arming the camera's timer");
}

}  // namespace relocd
