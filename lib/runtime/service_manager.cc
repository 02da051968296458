#include "runtime/service_manager.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "core/parse_number.h"

namespace relocd {
namespace {

constexpr std::size_t kMaxStatusSize = 1024;

std::string_view Variable(const char* const* environment, std::string_view name) {
  for (; environment != nullptr && *environment != nullptr; ++environment) {
    const std::string_view entry = *environment;
    if (entry.size() > name.size() && entry.substr(0, name.size()) == name &&
        entry[name.size()] == '=') {
      return entry.substr(name.size() + 1);
    }
  }
  return {};
}

/// An invalid one when `path` is none that the protocol allows, or nobody listens there.
UniqueFd Connect(std::string_view path) {
  sockaddr_un address{};
  const bool is_abstract = !path.empty() && path.front() == '@';
  if (path.size() < 2 || path.size() >= sizeof(address.sun_path) ||
      (path.front() != '/' && !is_abstract)) {
    return {};
  }
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  if (is_abstract) address.sun_path[0] = '\0';
  const auto size =
      static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size() + (is_abstract ? 0 : 1));

  UniqueFd fd(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd.valid()) return {};
  // POSIX passes every kind of address as a sockaddr.
  const auto* generic = reinterpret_cast<const sockaddr*>(&address);
  if (::connect(fd.get(), generic, size) != 0) return {};
  return fd;
}

std::optional<Duration> WatchdogTimeout(const char* const* environment) {
  const auto timeout_us = ParseInt64(Variable(environment, "WATCHDOG_USEC"));
  if (!timeout_us || *timeout_us <= 0) return std::nullopt;
  const std::string_view pid = Variable(environment, "WATCHDOG_PID");
  if (!pid.empty() && ParseInt64(pid) != std::int64_t{::getpid()}) return std::nullopt;
  return std::chrono::microseconds(std::min(*timeout_us, std::int64_t{3'600'000'000}));
}

}  // namespace

ServiceManager ServiceManager::FromEnvironment(const char* const* environment) {
  if (environment == nullptr) environment = ::environ;
  ServiceManager manager;
  manager.socket_ = Connect(Variable(environment, "NOTIFY_SOCKET"));
  manager.watchdog_timeout_ = WatchdogTimeout(environment);
  return manager;
}

void ServiceManager::Ready() {
  pending_ += "READY=1\n";
  Send("");
}

void ServiceManager::Status(std::string_view text) {
  std::string line(text.substr(0, kMaxStatusSize));
  std::replace(line.begin(), line.end(), '\n', ' ');  // a line's end would begin another field
  Send("STATUS=" + line + "\n");
}

void ServiceManager::Watchdog() {
  Send("WATCHDOG=1\n");
}

void ServiceManager::Stopping() {
  pending_ += "STOPPING=1\n";
  Send("");
}

void ServiceManager::ExtendTimeout(Duration duration) {
  const auto microseconds = std::chrono::duration_cast<std::chrono::microseconds>(duration);
  Send("EXTEND_TIMEOUT_USEC=" + std::to_string(microseconds.count()) + "\n");
}

std::optional<Duration> ServiceManager::WatchdogPeriod() const {
  if (!connected() || !watchdog_timeout_) return std::nullopt;
  return *watchdog_timeout_ / 4;
}

void ServiceManager::Send(std::string_view state) {
  if (!connected()) {
    pending_.clear();
    return;
  }
  const std::string datagram = pending_ + std::string(state);
  if (::send(socket_.get(), datagram.data(), datagram.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) {
    pending_.clear();
  } else {
    ++delayed_;
  }
}

}  // namespace relocd
