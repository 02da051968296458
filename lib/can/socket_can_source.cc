#include "can/socket_can_source.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>

#include <fmt/format.h>

#include "core/file.h"

namespace relocd {
namespace {

/// The counts of both; the state of the second.
CanBusStatus Sum(const CanBusStatus& before, const CanBusStatus& now) {
  return {.state = now.state,
          .received = before.received + now.received,
          .remote_frames = before.remote_frames + now.remote_frames,
          .error_frames = before.error_frames + now.error_frames,
          .malformed = before.malformed + now.malformed,
          .dropped = before.dropped + now.dropped,
          .bus_off = before.bus_off + now.bus_off,
          .interface_down = before.interface_down + now.interface_down};
}

}  // namespace

Result<void> SocketCanSource::Open() {
  auto socket = opener_();
  if (!socket) return std::move(socket).error();
  closed_ = status();
  socket_.emplace(std::move(socket).value());
  return {};
}

Result<std::optional<CanFrame>> SocketCanSource::Receive() {
  if (!socket_) return std::optional<CanFrame>();
  auto frame = socket_->Receive();
  if (frame) return frame;
  closed_ = status();
  closed_.state = CanBusState::kInterfaceDown;
  socket_.reset();
  return std::move(frame).error().WithContext(description_);
}

CanBusStatus SocketCanSource::status() const {
  return socket_ ? Sum(closed_, socket_->status()) : closed_;
}

Result<CanSocket> ConnectCanSocket(const std::string& path, const CanSocketOptions& options) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("socket path '{}' has {} bytes, must have less than {}",
                             path,
                             path.size(),
                             sizeof(address.sun_path))};
  }
  std::copy(path.begin(), path.end(), static_cast<char*>(address.sun_path));
  UniqueFd fd(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd.valid()) return SystemError(ErrorKind::kUnavailable, "opening a unix socket");
  if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    return SystemError(ErrorKind::kUnavailable, fmt::format("connecting to {}", path));
  }
  return CanSocket::FromFd(std::move(fd), options);
}

}  // namespace relocd
