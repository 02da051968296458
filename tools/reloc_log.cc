#include <cstdint>
#include <cstdio>
#include <iostream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "config/config.h"
#include "core/exit_code.h"
#include "core/file.h"
#include "log_csv.h"
#include "log_summary.h"
#include "messaging/in_process_bus.h"
#include "recording/log_reader.h"
#include "status_report.h"

// reloc log: what is in a recording, and its messages as tables.

namespace relocd {
namespace {

/// Says what of the log was no whole message.
void PrintDamage(const std::string& path, const LogReader::Counters& counters) {
  if (counters.damaged_places == 0) return;
  fmt::print(stderr,
             "reloc log: {}: {} damaged places, {} bytes skipped\n",
             path,
             counters.damaged_places,
             counters.skipped_bytes);
}

Result<int> Info(const std::string& path, bool json) {
  auto reader = LogReader::Open(path);
  if (!reader) return std::move(reader).error();
  LogSummary summary;
  while (const auto event = reader->Next())
    summary.Add(*event);
  fmt::print(
      "{}",
      json ? summary.FormatJson(reader->counters()) : summary.FormatTable(reader->counters()));
  return kExitOk;
}

/// What the daemons last said of themselves.
Result<int> LastStatus(const std::string& path, bool json) {
  auto reader = LogReader::Open(path);
  if (!reader) return std::move(reader).error();
  InProcessBus bus;
  StatusReport report;
  report.Subscribe(bus);
  MonotonicTime now{};
  bus.Subscribe<timesync_t>(
      channels::kTimesync, Delivery::kEvery, [&now](const timesync_t& message) {
        now = FromNanoseconds(message.mono_ns);
      });
  while (const auto event = reader->Next()) {
    if (auto ok = bus.PublishBytes(event->channel, event->data); !ok) return std::move(ok).error();
    bus.HandlePending();
  }
  PrintDamage(path, reader->counters());
  fmt::print("{}", json ? report.Json(now) : report.Text(now));
  return kExitOk;
}

struct ExportOptions {
  std::string log;
  std::string channel;
  std::string out;
  std::string config;
  std::int64_t time_origin_ns = 0;
};

Result<int> Export(const ExportOptions& options) {
  auto reader = LogReader::Open(options.log);
  if (!reader) return std::move(reader).error();
  LogCsvOptions rows{.time_origin_ns = options.time_origin_ns, .X_BC = {}};
  if (!options.config.empty()) {
    const auto config = LoadConfig(options.config, {});
    if (!config) return config.error();
    for (const auto& [name, camera] : config->cameras)
      rows.X_BC.emplace(name, camera.X_BC());
  }
  auto csv = LogCsv::ForChannel(options.channel, rows);
  if (!csv) return std::move(csv).error();
  std::string text = csv->header();
  std::int64_t messages = 0;
  std::int64_t undecodable = 0;
  while (const auto event = reader->Next()) {
    if (event->channel != options.channel) continue;
    ++messages;
    if (!csv->AppendRow(event->data, text)) ++undecodable;
  }
  PrintDamage(options.log, reader->counters());
  if (messages == 0) {
    fmt::print(stderr, "reloc log: {}: has no message on {}\n", options.log, options.channel);
  }
  if (undecodable > 0) {
    fmt::print(stderr,
               "reloc log: {}: {} of {} messages on {} do not decode\n",
               options.log,
               undecodable,
               messages,
               options.channel);
  }
  if (auto ok = WriteFileAtomically(options.out, text); !ok) return std::move(ok).error();
  return kExitOk;
}

int Finish(const Result<int>& result) {
  if (result) return *result;
  fmt::print(stderr, "reloc log: {}\n", result.error().message);
  return ExitCode(result.error());
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  CLI::App app("What is in a recording, and its messages as tables.", "reloc log");
  app.require_subcommand(1);

  std::string path;
  bool json = false;
  auto* info = app.add_subcommand("info", "channels, counts, rates, losses, latencies");
  info->add_option("log", path, "a log of lcm-logger or recorderd")->required();
  info->add_flag("--json", json, "for scripts");

  auto* status = app.add_subcommand("status", "what the daemons last said of themselves");
  status->add_option("log", path, "a log of lcm-logger or recorderd")->required();
  status->add_flag("--json", json, "for scripts");

  relocd::ExportOptions options;
  auto* exporting = app.add_subcommand("export", "one channel as CSV");
  exporting->add_option("log", options.log, "a log of lcm-logger or recorderd")->required();
  exporting->add_option("--channel", options.channel, relocd::LogCsv::kChannels)->required();
  exporting->add_option("--out", options.out, "the CSV file")->required();
  exporting->add_option("--time-origin-ns", options.time_origin_ns, "taken off every mono_ns");
  exporting->add_option(
      "--config",
      options.config,
      "the robot's YAML file: CAMERA_POSE then gives the body's pose, by where the "
      "camera is mounted");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (*info) return relocd::Finish(relocd::Info(path, json));
  if (*status) return relocd::Finish(relocd::LastStatus(path, json));
  return relocd::Finish(relocd::Export(options));
}
