#include <poll.h>

#include <chrono>
#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "config/config.h"
#include "core/exit_code.h"
#include "messaging/lcm_bus.h"
#include "status_report.h"

// reloc status: how the daemons are, and where the robot is.

namespace relocd {
namespace {

/// Every daemon says how it is once a second.
constexpr Duration kListenFor = std::chrono::milliseconds(1200);

void Listen(MessageBus& bus, MonotonicTime until) {
  for (MonotonicTime now = MonotonicClock::now(); now < until; now = MonotonicClock::now()) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - now);
    pollfd ready{.fd = bus.fd(), .events = POLLIN, .revents = 0};
    ::poll(&ready, 1, static_cast<int>(left.count()) + 1);
    bus.HandlePending();
  }
}

/// Listens for a round, and for further ones until all is well or the time is over.
///
/// @return whether all is well.
bool Watch(MessageBus& bus, const StatusReport& report, double wait_s) {
  const MonotonicTime end = MonotonicClock::now() + FromSeconds(wait_s);
  while (true) {
    Listen(bus, MonotonicClock::now() + kListenFor);
    if (report.Problems(MonotonicClock::now()).empty()) return true;
    if (MonotonicClock::now() >= end) return false;
  }
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  CLI::App app("Shows how the daemons are and where the robot is: exit 0 when all is well, else 1.",
               "reloc status");
  bool json = false;
  double wait_s = 0.0;
  std::string url = relocd::BusConfig().control_url;
  app.add_flag("--json", json, "for scripts");
  app.add_option("--wait", wait_s, "seconds to wait until all is well, in [0, 86400]");
  app.add_option("--lcm-url", url, "the control network")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (!(wait_s >= 0.0 && wait_s <= 86400.0)) {
    fmt::print(stderr, "reloc status: --wait is {}, must be in [0, 86400]\n", wait_s);
    return relocd::kExitUsage;
  }
  auto bus = relocd::LcmBus::Open(url);
  if (!bus) {
    fmt::print(stderr, "reloc status: {}\n", bus.error().message);
    return relocd::ExitCode(bus.error());
  }
  relocd::StatusReport report;
  report.Subscribe(**bus);
  if (auto ok = (*bus)->CheckListening(); !ok) {
    fmt::print(stderr, "reloc status: {}\n", ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  const bool is_well = relocd::Watch(**bus, report, wait_s);
  const auto now = relocd::MonotonicClock::now();
  fmt::print("{}", json ? report.Json(now) : report.Text(now));
  std::fflush(stdout);
  for (const std::string& problem : report.Problems(now))
    fmt::print(stderr, "reloc status: {}\n", problem);
  return is_well ? relocd::kExitOk : relocd::kExitFailure;
}
