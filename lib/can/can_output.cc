#include "can/can_output.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/file.h"
#include "core/unique_fd.h"

namespace relocd {
namespace {

constexpr std::string_view kUnixPrefix = "unix:";

/// A frame as the kernel's structures have it.
struct RawFrame {
  canfd_frame frame{};
  std::size_t size = CAN_MTU;
};

RawFrame ToRaw(const CanFrame& frame) {
  RawFrame raw;
  raw.frame.can_id = KernelCanId(frame);
  raw.frame.len = frame.size;
  if (frame.fd) {
    raw.size = CANFD_MTU;
    raw.frame.flags = static_cast<std::uint8_t>((frame.bit_rate_switch ? CANFD_BRS : 0) |
                                                (frame.error_state_indicator ? CANFD_ESI : 0));
  }
  std::copy(
      frame.payload().begin(), frame.payload().end(), static_cast<std::uint8_t*>(raw.frame.data));
  return raw;
}

bool IsBusy(int error) {
  return error == EAGAIN || error == EWOULDBLOCK || error == ENOBUFS;
}

class InterfaceOutput final : public CanOutput {
 public:
  static Result<std::unique_ptr<CanOutput>> Open(const std::string& interface) {
    UniqueFd fd(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
    if (!fd.valid()) {
      return SystemError(ErrorKind::kUnavailable,
                         fmt::format("opening a CAN socket for '{}' (unix:PATH needs no CAN in the "
                                     "kernel)",
                                     interface));
    }
    ifreq request{};
    if (interface.empty() || interface.size() >= sizeof(request.ifr_name)) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("interface '{}', must have 1 to {} characters",
                               interface,
                               sizeof(request.ifr_name) - 1)};
    }
    std::copy(interface.begin(), interface.end(), static_cast<char*>(request.ifr_name));
    if (auto ok = Bind(fd.get(), interface, request); !ok) return std::move(ok).error();
    return std::unique_ptr<CanOutput>(new InterfaceOutput(interface, std::move(fd)));
  }

  Result<void> Send(const CanFrame& frame) override {
    const RawFrame raw = ToRaw(frame);
    if (::write(fd_.get(), &raw.frame, raw.size) == static_cast<ssize_t>(raw.size)) {
      ++counters_.sent;
      return {};
    }
    if (IsBusy(errno)) {
      ++counters_.dropped;
      return {};
    }
    return SystemError(ErrorKind::kUnavailable, fmt::format("sending onto {}", interface_));
  }

 private:
  InterfaceOutput(std::string interface, UniqueFd fd)
      : interface_(std::move(interface)), fd_(std::move(fd)) {}

  static Result<void> Bind(int fd, const std::string& interface, ifreq& request) {
    if (::ioctl(fd, SIOCGIFINDEX, &request) != 0) {
      return SystemError(
          ErrorKind::kUnavailable,
          fmt::format("looking for the interface {0} (ip link add {0} type vcan)", interface));
    }
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = request.ifr_ifindex;
    const int enable = 1;  // older kernels have no CAN FD, and need none for other frames
    ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &enable, sizeof(enable));
    // Only sends: otherwise what others send would wait here for ever.
    ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0);
    if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
      return SystemError(ErrorKind::kUnavailable,
                         fmt::format("binding to {}, which must be a CAN interface", interface));
    }
    if (::ioctl(fd, SIOCGIFFLAGS, &request) != 0) {
      return SystemError(ErrorKind::kUnavailable, fmt::format("looking at {}", interface));
    }
    if ((request.ifr_flags & IFF_UP) != 0) return {};
    return Error{ErrorKind::kUnavailable,
                 fmt::format("{0} is down, must be up: ip link set {0} up", interface)};
  }

  std::string interface_;
  UniqueFd fd_;
};

class ListeningOutput final : public CanOutput {
 public:
  static Result<std::unique_ptr<CanOutput>> Open(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof(address.sun_path)) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("socket path '{}' has {} bytes, must have 1 to {}",
                               path,
                               path.size(),
                               sizeof(address.sun_path) - 1)};
    }
    std::copy(path.begin(), path.end(), static_cast<char*>(address.sun_path));
    UniqueFd fd(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!fd.valid()) return SystemError(ErrorKind::kUnavailable, "opening a unix socket");
    constexpr int kBacklog = 8;
    DeleteIfDeserted(address);
    if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
      return SystemError(ErrorKind::kUnavailable, fmt::format("making the socket {}", path));
    }
    if (::listen(fd.get(), kBacklog) != 0) {
      return SystemError(ErrorKind::kUnavailable, fmt::format("listening on {}", path));
    }
    return std::unique_ptr<CanOutput>(new ListeningOutput(path, std::move(fd)));
  }

  ~ListeningOutput() override { ::unlink(path_.c_str()); }
  ListeningOutput(const ListeningOutput&) = delete;
  ListeningOutput& operator=(const ListeningOutput&) = delete;
  ListeningOutput(ListeningOutput&&) = delete;
  ListeningOutput& operator=(ListeningOutput&&) = delete;

  Result<void> Send(const CanFrame& frame) override {
    while (true) {
      UniqueFd client(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (!client.valid()) break;
      clients_.push_back(std::move(client));
    }
    const RawFrame raw = ToRaw(frame);
    std::erase_if(clients_, [&](const UniqueFd& client) { return !SendTo(client.get(), raw); });
    return {};
  }

 private:
  ListeningOutput(std::string path, UniqueFd listener)
      : path_(std::move(path)), listener_(std::move(listener)) {}

  /// Deletes a socket that a process left behind which was killed.
  static void DeleteIfDeserted(const sockaddr_un& address) {
    const char* const path = static_cast<const char*>(address.sun_path);
    struct stat found {};
    // Connecting to any other file is refused, too.
    if (::lstat(path, &found) != 0 || !S_ISSOCK(found.st_mode)) return;
    const UniqueFd probe(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const auto* const any = reinterpret_cast<const sockaddr*>(&address);
    const bool is_deserted =
        ::connect(probe.get(), any, sizeof(address)) != 0 && errno == ECONNREFUSED;
    if (is_deserted) ::unlink(path);
  }

  /// Whether the client is still there.
  bool SendTo(int client, const RawFrame& raw) {
    if (::send(client, &raw.frame, raw.size, MSG_NOSIGNAL) >= 0) {
      ++counters_.sent;
      return true;
    }
    ++counters_.dropped;
    return IsBusy(errno);
  }

  std::string path_;
  UniqueFd listener_;
  std::vector<UniqueFd> clients_;
};

}  // namespace

Result<std::unique_ptr<CanOutput>> CanOutput::Open(const std::string& target) {
  if (target.starts_with(kUnixPrefix)) {
    return ListeningOutput::Open(target.substr(kUnixPrefix.size()));
  }
  return InterfaceOutput::Open(target);
}

}  // namespace relocd
