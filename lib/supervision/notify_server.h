#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/result.h"
#include "core/time.h"
#include "core/unique_fd.h"

namespace relocd {

/// One datagram of the protocol of sd_notify(3): what a process says about itself.
struct Notification {
  bool ready = false;
  bool stopping = false;
  bool alive = false;  ///< WATCHDOG=1
  bool hung = false;   ///< WATCHDOG=trigger
  std::optional<Duration> extend_timeout{};
  std::optional<std::string> status{};  ///< Printable, on one line.

  bool operator==(const Notification&) const = default;
};

/// Reads a datagram that anybody may have written. Fields that are not ours (FDSTORE=1, ERRNO=2)
/// are passed over, as the protocol wants.
///
/// @return kInvalidInput for a line without `=`, a value that the field cannot have, and for more
/// than 4096 bytes.
Result<Notification> ParseNotification(std::string_view datagram);

/// The receiving end of one child's NOTIFY_SOCKET: an abstract Unix socket, so that there is no
/// file to be left behind. One for each child, so that one that floods its own delays nobody else.
///
/// Thread-bound.
class NotifyServer {
 public:
  static Result<NotifyServer> Open();

  /// What the child's NOTIFY_SOCKET is to be, as in `@0001f`.
  [[nodiscard]] const std::string& address() const { return address_; }

  /// Readable when something waits.
  [[nodiscard]] int fd() const { return fd_.get(); }

  /// The next notification of process `pid`; nothing when none waits. What others sent, by the
  /// kernel's word, and what does not parse is dropped and counted.
  std::optional<Notification> Receive(pid_t pid);

  [[nodiscard]] std::int64_t refused() const { return refused_; }

 private:
  NotifyServer(UniqueFd fd, std::string address)
      : fd_(std::move(fd)), address_(std::move(address)) {}

  UniqueFd fd_;
  std::string address_;
  std::int64_t refused_ = 0;
};

}  // namespace relocd
