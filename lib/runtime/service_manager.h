#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/time.h"
#include "core/unique_fd.h"

namespace relocd {

/// Tells whoever started this process how it is: systemd, or relocd's supervisor, both by the
/// protocol of sd_notify(3). Without a NOTIFY_SOCKET in the environment every call does nothing.
///
/// Never blocks, where libsystemd's sd_notify waits for room in the socket: a manager that hangs
/// must not stop the odometry. A state that finds no room goes out with the next call.
///
/// Thread-bound.
class ServiceManager {
 public:
  /// Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID.
  ///
  /// @param environment  as in environ(7); the default is the process's own.
  static ServiceManager FromEnvironment(const char* const* environment = nullptr);

  [[nodiscard]] bool connected() const { return socket_.valid(); }

  /// The process does its work now.
  void Ready();

  /// One line for people, shown by `reloc status` and `systemctl status`.
  void Status(std::string_view text);

  /// The event loop turns: to be called once per WatchdogPeriod from the loop itself, so that a
  /// handler that hangs is noticed.
  void Watchdog();

  /// The process was asked to end, and does.
  void Stopping();

  /// The next sign of life may come only after `duration`, as while loading a map.
  void ExtendTimeout(Duration duration);

  /// How often to call Watchdog: a quarter of the time after which the manager gives up on this
  /// process. Nothing when it does not watch.
  [[nodiscard]] std::optional<Duration> WatchdogPeriod() const;

  /// States that found no room.
  [[nodiscard]] std::int64_t delayed() const { return delayed_; }

 private:
  void Send(std::string_view state);

  UniqueFd socket_;
  std::optional<Duration> watchdog_timeout_;
  std::string pending_;  ///< READY or STOPPING that found no room, to be sent first.
  std::int64_t delayed_ = 0;
};

}  // namespace relocd
