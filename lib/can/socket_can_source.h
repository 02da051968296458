#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "can/can_socket.h"
#include "can/can_source.h"

namespace relocd {

/// A CanSource over a CanSocket that it makes anew whenever it is opened.
class SocketCanSource final : public CanSource {
 public:
  using Opener = std::function<Result<CanSocket>()>;

  SocketCanSource(std::string description, Opener opener)
      : description_(std::move(description)), opener_(std::move(opener)) {}

  Result<void> Open() override;
  [[nodiscard]] int fd() const override { return socket_ ? socket_->fd() : -1; }
  Result<std::optional<CanFrame>> Receive() override;
  [[nodiscard]] CanBusStatus status() const override;
  [[nodiscard]] std::string description() const override { return description_; }

 private:
  std::string description_;
  Opener opener_;
  std::optional<CanSocket> socket_;
  CanBusStatus closed_;  ///< The counts of the sockets before this one.
};

/// Connects to a SOCK_SEQPACKET socket in the file system. @return kUnavailable when none listens.
Result<CanSocket> ConnectCanSocket(const std::string& path, const CanSocketOptions& options);

}  // namespace relocd
