#include "supervision/notify_server.h"

#include <errno.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <limits>

#include <fmt/format.h>

#include "core/file.h"
#include "core/parse_number.h"

namespace relocd {
namespace {

constexpr std::size_t kMaxDatagramSize = 4096;
constexpr std::size_t kMaxStatusSize = 200;

/// So many datagrams are looked at in one call at most: a flood must not keep the supervisor.
constexpr int kMaxRefusedAtOnce = 64;

Error Invalid(std::string_view key, std::string_view value, const char* allowed) {
  return {ErrorKind::kInvalidInput,
          fmt::format("notification: {} is '{}', must be {}", key, value.substr(0, 40), allowed)};
}

std::string Printable(std::string_view text) {
  std::string printable(text.substr(0, kMaxStatusSize));
  std::replace_if(
      printable.begin(), printable.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return printable;
}

Result<void> ReadField(std::string_view key, std::string_view value, Notification& notification) {
  if (key == "READY" || key == "STOPPING") {
    if (value != "1") return Invalid(key, value, "1");
    (key == "READY" ? notification.ready : notification.stopping) = true;
  } else if (key == "WATCHDOG") {
    if (value != "1" && value != "trigger") return Invalid(key, value, "1 or trigger");
    (value == "1" ? notification.alive : notification.hung) = true;
  } else if (key == "EXTEND_TIMEOUT_USEC") {
    const auto microseconds = ParseInt64(value);
    constexpr std::int64_t kMax = std::numeric_limits<std::int64_t>::max() / 1'000'000;
    if (!microseconds || *microseconds < 0) return Invalid(key, value, "a number of us >= 0");
    notification.extend_timeout = std::chrono::microseconds(std::min(*microseconds, kMax));
  } else if (key == "STATUS") {
    notification.status = Printable(value);
  }
  return {};
}

/// Who sent it, as the kernel says; 0 when it does not.
pid_t SenderOf(msghdr& header) {
  for (cmsghdr* part = CMSG_FIRSTHDR(&header); part != nullptr; part = CMSG_NXTHDR(&header, part)) {
    if (part->cmsg_level == SOL_SOCKET && part->cmsg_type == SCM_CREDENTIALS) {
      ucred credentials{};
      std::memcpy(&credentials, CMSG_DATA(part), sizeof(credentials));
      return credentials.pid;
    }
  }
  return 0;
}

}  // namespace

Result<Notification> ParseNotification(std::string_view datagram) {
  if (datagram.size() > kMaxDatagramSize) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format(
            "notification: has {} bytes, must have at most {}", datagram.size(), kMaxDatagramSize)};
  }
  Notification notification;
  while (!datagram.empty()) {
    const std::size_t end = std::min(datagram.find('\n'), datagram.size());
    const std::string_view line = datagram.substr(0, end);
    datagram.remove_prefix(std::min(end + 1, datagram.size()));
    if (line.empty()) continue;
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos || equals == 0) {
      return Invalid("line", Printable(line), "KEY=value");
    }
    auto ok = ReadField(line.substr(0, equals), line.substr(equals + 1), notification);
    if (!ok) return std::move(ok).error();
  }
  return notification;
}

Result<NotifyServer> NotifyServer::Open() {
  UniqueFd fd(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd.valid()) return SystemError(ErrorKind::kInternal, "opening a notify socket");
  const int on = 1;
  if (::setsockopt(fd.get(), SOL_SOCKET, SO_PASSCRED, &on, sizeof(on)) != 0) {
    return SystemError(ErrorKind::kInternal, "asking for a notify socket's credentials");
  }
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  auto* generic = reinterpret_cast<sockaddr*>(&address);  // as POSIX passes every address
  // With the family alone the kernel chooses an abstract name that is free.
  if (::bind(fd.get(), generic, sizeof(sa_family_t)) != 0) {
    return SystemError(ErrorKind::kInternal, "naming a notify socket");
  }
  socklen_t size = sizeof(address);
  if (::getsockname(fd.get(), generic, &size) != 0) {
    return SystemError(ErrorKind::kInternal, "reading a notify socket's name");
  }
  const std::size_t name_size = size - offsetof(sockaddr_un, sun_path) - 1;
  std::string name(&address.sun_path[0], name_size + 1);
  name.front() = '@';  // for the NUL that makes it abstract
  return NotifyServer(std::move(fd), std::move(name));
}

std::optional<Notification> NotifyServer::Receive(pid_t pid) {
  for (int refused_now = 0; refused_now < kMaxRefusedAtOnce; ++refused_now) {
    std::array<char, kMaxDatagramSize> bytes{};
    // Room for the credentials only: file descriptors that somebody sends along are closed by the
    // kernel.
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(ucred))> control{};
    iovec part{.iov_base = bytes.data(), .iov_len = bytes.size()};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    const ssize_t size = ::recvmsg(fd_.get(), &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return std::nullopt;

    const bool is_whole = (header.msg_flags & MSG_TRUNC) == 0;
    if (is_whole && pid > 0 && SenderOf(header) == pid) {
      auto notification =
          ParseNotification(std::string_view(bytes.data(), static_cast<std::size_t>(size)));
      if (notification) return std::move(notification).value();
    }
    ++refused_;
  }
  return std::nullopt;
}

}  // namespace relocd
