#include "can/can_source.h"

#include <fcntl.h>

#include <utility>


#include "can/can_socket.h"
#include "can/candump_source.h"
#include "can/socket_can_source.h"
#include "core/file.h"

namespace relocd {
namespace {

/// An inherited socket stays open for the next try: each gets a duplicate.
Result<CanSocket> DuplicateCanSocket(int inherited, const CanSocketOptions& options) {
  UniqueFd fd(::fcntl(inherited, F_DUPFD_CLOEXEC, 0));
  const std::string name = "file descriptor " + std::to_string(inherited);
  if (!fd.valid()) return SystemError(ErrorKind::kInvalidInput, name);
  if (::fcntl(fd.get(), F_SETFL, O_NONBLOCK) != 0) {
    return SystemError(ErrorKind::kInvalidInput, name);
  }
  return CanSocket::FromFd(std::move(fd), options);
}

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
        [=] { return DuplicateCanSocket(config.fd, options); });
  }
  return std::make_unique<SocketCanSource>(
      config.interface, [=] { return CanSocket::Open(config.interface, options); });
}

}  // namespace relocd
