#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "relocd/supervisor_node.h"

#include "config/config.h"
#include "core/result.h"
#include "core/unique_fd.h"
#include "daemon/daemon_options.h"
#include "messaging/lcm_bus.h"
#include "runtime/event_loop.h"
#include "runtime/service_manager.h"
#include "supervision/supervisor.h"

namespace relocd {

/// The supervisor's process: the child processes, the messages about them, systemd, and signals.
/// SIGTERM and SIGINT stop the children in order (the second one kills them), SIGHUP reads the
/// config again.
///
/// Without LCM the children are looked after all the same. Thread-bound.
class Relocd {
 public:
  Relocd(Config config, DaemonOptions options);

  /// Returns when all children have stopped.
  Result<void> Run();

 private:
  Result<void> Prepare();
  Result<void> StartTimers();
  Result<void> HookSignals();

  /// Opens the control bus if it is not open; says what is wrong when that changes.
  void OpenBus();
  void Turn();
  void Tick();
  void Reload();
  [[nodiscard]] std::vector<ProcessSpec> Table() const;
  [[nodiscard]] EffectiveConfig Effective() const;
  /// Logs a trouble with LCM when it is another than before, and its end.
  void ReportBusTrouble(const std::string& trouble);

  Config config_;
  DaemonOptions options_;
  std::string program_directory_;
  ServiceManager service_manager_;
  SupervisorNode node_;
  std::optional<EventLoop> loop_;
  UniqueFd hangup_;  ///< A signalfd for SIGHUP.
  std::optional<Supervisor> supervisor_;
  std::unique_ptr<LcmBus> bus_;
  std::string bus_url_;
  std::string bus_trouble_;
  MonotonicTime started_{};
  bool is_ready_ = false;
  bool is_stopping_ = false;
};

}  // namespace relocd
