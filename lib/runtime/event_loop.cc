#include "runtime/event_loop.h"

#include <errno.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <system_error>
#include <utility>

namespace relocd {
namespace {

Error SystemError(const char* doing) {
  const int error = errno;
  return {ErrorKind::kInternal, std::string(doing) + ": " + std::generic_category().message(error)};
}

}  // namespace

Result<EventLoop> EventLoop::Create() {
  sigset_t mask;
  ::sigemptyset(&mask);
  ::sigaddset(&mask, SIGINT);
  ::sigaddset(&mask, SIGTERM);
  if (::pthread_sigmask(SIG_BLOCK, &mask, nullptr) != 0) return SystemError("blocking signals");
  if (::signal(SIGPIPE, SIG_IGN) == SIG_ERR) return SystemError("ignoring SIGPIPE");

  UniqueFd epoll(::epoll_create1(EPOLL_CLOEXEC));
  if (!epoll.valid()) return SystemError("creating an epoll instance");
  UniqueFd signals(::signalfd(-1, &mask, SFD_NONBLOCK | SFD_CLOEXEC));
  if (!signals.valid()) return SystemError("creating a signalfd");

  const int signal_fd = signals.get();
  EventLoop loop(std::move(epoll), std::move(signals));
  if (auto ok = loop.OnReadable(signal_fd, {}); !ok) return std::move(ok).error();
  return loop;
}

Result<void> EventLoop::OnReadable(int fd, Handler handler) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = fd;
  if (::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) != 0)
    return SystemError("watching an fd");
  handlers_[fd] = std::move(handler);
  return {};
}

Result<void> EventLoop::Every(Duration period, Handler handler) {
  UniqueFd timer(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
  if (!timer.valid()) return SystemError("creating a timer");
  itimerspec spec{};
  spec.it_interval.tv_sec = period / std::chrono::seconds(1);
  spec.it_interval.tv_nsec = (period % std::chrono::seconds(1)).count();
  spec.it_value = spec.it_interval;
  if (::timerfd_settime(timer.get(), 0, &spec, nullptr) != 0) return SystemError("arming a timer");

  const int fd = timer.get();
  timers_.emplace(fd, std::move(timer));
  return OnReadable(fd, [fd, handler = std::move(handler)] {
    std::uint64_t expirations = 0;
    if (::read(fd, &expirations, sizeof(expirations)) == sizeof(expirations)) handler();
  });
}

Result<void> EventLoop::Run() {
  running_ = true;
  while (running_) {
    std::array<epoll_event, 8> events{};
    const int count =
        ::epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), -1);
    if (count < 0 && errno != EINTR) return SystemError("waiting for events");
    for (int i = 0; i < count && running_; ++i)
      HandleReadable(events.at(static_cast<std::size_t>(i)).data.fd);
  }
  return {};
}

void EventLoop::HandleReadable(int fd) {
  if (fd != signals_.get()) {
    handlers_.at(fd)();
    return;
  }
  signalfd_siginfo taken{};  // so that Run can be called again, to stop in an orderly way
  static_cast<void>(::read(fd, &taken, sizeof(taken)));
  Stop();
}

}  // namespace relocd
