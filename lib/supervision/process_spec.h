#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/result.h"

namespace relocd {

/// How one child process is started, watched and stopped.
struct ProcessConfig {
  bool enabled = true;
  std::vector<std::string> command{};
  std::vector<std::string> after{};
  double watchdog_s = 2.0;
  double start_timeout_s = 10.0;
  double stop_timeout_s = 2.0;
  int stop_tier = 0;
  std::string scheduling = "other";
  int priority = 0;
  int nice = 0;
  double rss_limit_mb = 0.0;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("enabled", self.enabled, "false: not started");
    visit("command",
          self.command,
          "program and arguments, without a slash beside relocd; empty: the daemon of this name");
    visit("after",
          self.after,
          "starts when these are ready, have failed, or had their start_timeout_s");
    visit(
        "watchdog_s",
        self.watchdog_s,
        "0 or in [0.1, 3600]; restarted after so long without a sign of life; 0: not watched, and "
        "ready at once");
    visit("start_timeout_s",
          self.start_timeout_s,
          "in [0.1, 3600]; for its first sign of life, or of progress at a large map; others wait "
          "for it so long");
    visit("stop_timeout_s",
          self.stop_timeout_s,
          "in [0.1, 10]; from SIGTERM to SIGKILL; all tiers together: 10 at most");
    visit("stop_tier", self.stop_tier, "in [0, 9]; lower ones are stopped first");
    visit("scheduling", self.scheduling, "other or fifo (real time)");
    visit("priority", self.priority, "fifo: in [1, 99]; other: 0");
    visit("nice", self.nice, "in [-20, 19]; other: higher ones yield");
    visit("rss_limit_mb",
          self.rss_limit_mb,
          ">= 0; restarted when its resident memory is above; 0: no limit");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;

  bool operator==(const ProcessConfig&) const = default;
};

/// What relocd starts, and how patient it is.
///
/// By default consumers start before producers (the recorder, then smootherd and inferenced, then
/// odometryd and the cameras), so that nothing published at the start is lost, and stop after
/// them, the recorder last.
struct SupervisionConfig {
  double playback_delay_s = 2.0;
  double backoff_initial_s = 0.1;
  double backoff_max_s = 5.0;
  double backoff_reset_s = 30.0;

  /// A disk may take seconds for a write, as an SD card that tidies up: to end recorderd for that
  /// would lose what it waits to write.
  ProcessConfig recorderd{
      .watchdog_s = 10.0, .start_timeout_s = 3.0, .stop_timeout_s = 5.0, .stop_tier = 2};
  ProcessConfig smootherd{
      .after = {"recorderd"}, .stop_tier = 1, .scheduling = "fifo", .priority = 10};
  ProcessConfig inferenced{.after = {"recorderd"}, .watchdog_s = 10.0, .stop_tier = 1, .nice = 5};
  ProcessConfig odometryd{
      .after = {"recorderd", "smootherd"}, .scheduling = "fifo", .priority = 20};
  ProcessConfig camerad{.after = {"recorderd", "inferenced"}};
  std::map<std::string, ProcessConfig> others;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("playback_delay_s",
          self.playback_delay_s,
          "in [0, 60]; how long after relocd's start file cameras and CAN logs begin to play");
    visit("backoff_initial_s",
          self.backoff_initial_s,
          "in [0.01, 60]; from the end of a child to its next start; doubles each time");
    visit("backoff_max_s", self.backoff_max_s, "in [backoff_initial_s, 3600]");
    visit("backoff_reset_s",
          self.backoff_reset_s,
          "> 0; a child that ran for so long begins with backoff_initial_s again");
    visit("recorderd", self.recorderd, "Writes all messages to the log.");
    visit("smootherd", self.smootherd, "Fuses odometry and camera poses.");
    visit("inferenced", self.inferenced, "Finds the camera's pose in an image.");
    visit("odometryd", self.odometryd, "Makes odometry from CAN frames.");
    visit("camerad", self.camerad, "One for each camera, named camerad_<camera>.");
    visit("others", self.others, "Further programs by name, started with their command as it is.");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// One row of the supervisor's table.
struct ProcessSpec {
  std::string name;
  ProcessConfig config;

  /// Stands for what the program reads at its start besides its arguments, as the text of its part
  /// of the config: another one means that a reload restarts it.
  std::string settings;

  bool operator==(const ProcessSpec&) const = default;
};

/// What is needed besides the config to fill the table.
struct ProcessTableContext {
  std::vector<std::string> cameras;    ///< By name; one camerad each.
  std::string program_directory;       ///< Where commands without a slash are.
  std::vector<std::string> arguments;  ///< For each of our daemons, as in `--config`, `x.yaml`.
};

/// The enabled processes of a valid config, with whole commands, and `after` without those that are
/// not enabled.
std::vector<ProcessSpec> MakeProcessTable(const SupervisionConfig& config,
                                          const ProcessTableContext& context);

}  // namespace relocd
