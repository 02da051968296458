#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "config/config.h"
#include "core/result.h"
#include "core/time.h"
#include "daemon/daemon_options.h"
#include "messaging/message_bus.h"
#include "messaging/node_status.h"
#include "runtime/event_loop.h"
#include "runtime/service_manager.h"

namespace relocd {

/// What every daemon is given to work with. All of it outlives the daemon.
struct DaemonContext {
  const Config& config;
  EventLoop& loop;
  MessageBus& control_bus;  ///< The loop already hands on its messages.
  MessageBus* image_bus;    ///< The same; null unless DaemonInfo::uses_images.
  ServiceManager& service_manager;
  std::int64_t run_id = 0;  ///< For the messages of this process.
  std::string instance;     ///< Of DaemonInfo::instance_option, as the camera's name; else empty.
};

/// A daemon's nodes and drivers, hooked into the loop by the function that made it.
class Daemon {
 public:
  Daemon() = default;
  virtual ~Daemon() = default;
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;
  Daemon(Daemon&&) = delete;
  Daemon& operator=(Daemon&&) = delete;

  /// What STATUS_<daemon> says, called once a second. The buses' counters are added to it.
  [[nodiscard]] virtual NodeStatus Status(const ClockReading& now) = 0;

  /// Called once when the process was asked to end, before the loop's last round is over.
  virtual void Stop(const ClockReading& /*now*/) {}
};

/// The main function of a daemon: reads the command line (--config, --set, --check-config,
/// --print-config, --version,
/// --lcm-url, --image-lcm-url) and the config, opens the networks, makes the daemon, says READY,
/// publishes STATUS, feeds the watchdog, and runs until SIGTERM or SIGINT.
///
/// @return the process's exit code, see core/exit_code.h.
int RunDaemon(int argc,
              char** argv,
              const DaemonInfo& info,
              const std::function<Result<std::unique_ptr<Daemon>>(DaemonContext&)>& make);

/// Writes one line to stderr in the journal's form, `<3>odometryd: ...`.
///
/// @param priority  syslog's: 3 error, 4 warning, 5 notice, 6 info.
void LogLine(int priority, const std::string& daemon, const std::string& text);

/// A number that tells this start of the process from every other.
std::int64_t RandomRunId();

/// Resident memory of this process.
std::int64_t ResidentBytes();

}  // namespace relocd
