#include "can/can_source.h"

#include <fcntl.h>

#include <utility>

#include "can/can_socket.h"
#include "can/candump_source.h"
#include "can/socket_can_source.h"
#include "core/file.h"

namespace relocd {
namespace {

/// Takes over an inherited socket, which there is only once.
class InheritedCanSocket {
 public:
  InheritedCanSocket(int fd, CanSocketOptions options) : fd_(fd), options_(std::move(options)) {}

  Result<CanSocket> operator()() {
    const std::string name = "file descriptor " + std::to_string(fd_);
    if (std::exchange(taken_, true)) {
      return Error{ErrorKind::kUnavailable, name + ": was lost, and can only be inherited again"};
    }
    if (::fcntl(fd_, F_SETFL, O_NONBLOCK) != 0 || ::fcntl(fd_, F_SETFD, FD_CLOEXEC) != 0) {
      return SystemError(ErrorKind::kInvalidInput, name);
    }
    return CanSocket::FromFd(UniqueFd(fd_), options_);
  }

 private:
  int fd_;
  CanSocketOptions options_;
  bool taken_ = false;
};

}  // namespace

std::unique_ptr<CanSource> MakeCanSource(const CanConfig& config,
                                         std::vector<CanId> ids,
                                         MonotonicTime epoch) {
  if (config.source == "candump") {
    return std::make_unique<CandumpSource>(config, std::move(ids), epoch);
  }
  const CanSocketOptions options{.ids = std::move(ids), .fd_frames = config.fd_frames};
  if (config.source == "unix") {
    return std::make_unique<SocketCanSource>(
        "CAN frames from " + config.path, [=] { return ConnectCanSocket(config.path, options); });
  }
  if (config.source == "fd") {
    return std::make_unique<SocketCanSource>(
        "CAN frames from file descriptor " + std::to_string(config.fd),
        InheritedCanSocket(config.fd, options));
  }
  return std::make_unique<SocketCanSource>(
      config.interface, [=] { return CanSocket::Open(config.interface, options); });
}

}  // namespace relocd
