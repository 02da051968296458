#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "can/candump_log.h"
#include "can/dbc.h"
#include "can/message_guard.h"
#include "can/signal.h"
#include "config/config.h"
#include "core/exit_code.h"
#include "core/file.h"

// reloc can: what is said on a recorded CAN bus.

namespace relocd {
namespace {

struct Options {
  std::string dbc;
  std::string config;
  std::vector<std::string> overrides;
  std::string can;
  std::string interface;
  std::vector<std::string> messages;
  std::vector<std::string> signals;
  std::string out;
  bool wide = false;
};

/// A signal that is asked for, and what it said.
struct DecodedSignal {
  const DbcSignal* signal = nullptr;
  std::int64_t values = 0;
  std::int64_t not_finite = 0;
  long double minimum = std::numeric_limits<long double>::infinity();
  long double maximum = -std::numeric_limits<long double>::infinity();
  long double sum = 0.0;
  long double last = 0.0;
  std::string last_name{};

  void Add(long double value, std::string name) {
    if (!std::isfinite(value)) {
      ++not_finite;
      return;
    }
    ++values;
    minimum = std::min(minimum, value);
    maximum = std::max(maximum, value);
    sum += value;
    last = value;
    last_name = std::move(name);
  }
};

/// A message that is asked for.
struct DecodedMessage {
  const DbcMessage* message = nullptr;
  MessageGuard guard;
  std::vector<DecodedSignal> signals{};
  std::int64_t first_ns = 0;
  std::int64_t last_ns = 0;
};

using Decoder = std::map<CanId, DecodedMessage>;

/// What reads the frames: the DBC file, and the rules of its messages.
struct Sources {
  DbcFile dbc;
  std::map<std::string, MessageRule> rules{};
};

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

Result<Sources> ReadSources(const Options& options) {
  std::string path = options.dbc;
  std::map<std::string, MessageRule> rules;
  if (!options.config.empty()) {
    auto config = LoadConfig(options.config, options.overrides);
    if (!config) return std::move(config).error();
    if (path.empty()) path = config->can.dbc_file;
    rules = config->can.messages;
  }
  if (path.empty()) return Invalid("no DBC file, must be given by --dbc or --config");
  auto dbc = DbcFile::Read(path);
  if (!dbc) return std::move(dbc).error();
  for (const auto& [name, rule] : rules) {
    if (auto message = dbc->FindMessage(name); !message) return std::move(message).error();
  }
  return Sources{.dbc = std::move(dbc).value(), .rules = std::move(rules)};
}

/// The signals of a message that --message and --signal ask for; all without these.
Result<Decoder> MakeDecoder(const Options& options, const Sources& sources) {
  for (const std::string& name : options.messages) {
    if (auto found = sources.dbc.FindMessage(name); !found) return std::move(found).error();
  }
  for (const std::string& name : options.signals) {
    if (auto found = sources.dbc.FindSignal(name); !found) return std::move(found).error();
  }
  const std::set<std::string> messages(options.messages.begin(), options.messages.end());
  const std::set<std::string> signals(options.signals.begin(), options.signals.end());
  const bool all = messages.empty() && signals.empty();
  Decoder decoder;
  for (const DbcMessage& message : sources.dbc.messages()) {
    const auto rule = sources.rules.find(message.name);
    auto guard =
        MessageGuard::Create(rule == sources.rules.end() ? MessageRule() : rule->second, message);
    if (!guard) return std::move(guard).error().WithContext(sources.dbc.path());
    DecodedMessage decoded{.message = &message, .guard = std::move(guard).value()};
    for (const DbcSignal& signal : message.signals) {
      const bool wanted = all || messages.contains(message.name) ||
                          signals.contains(message.name + "." + signal.name);
      if (wanted) decoded.signals.push_back({.signal = &signal});
    }
    if (!decoded.signals.empty()) decoder.emplace(message.id, std::move(decoded));
  }
  if (options.wide && decoder.size() != 1) {
    return Invalid(
        fmt::format("--wide with {} messages, must be with one: --message NAME", decoder.size()));
  }
  return decoder;
}

std::string VerdictName(FrameVerdict verdict) {
  switch (verdict) {
    case FrameVerdict::kValid:
      return "valid";
    case FrameVerdict::kShort:
      return "short";
    case FrameVerdict::kBadChecksum:
      return "bad_checksum";
    case FrameVerdict::kStuckCounter:
      return "stuck_counter";
  }
  return "";
}

std::string ValueName(const DbcSignal& signal, std::span<const std::uint8_t> payload) {
  const auto bits = DecodeBits(signal, payload);
  if (!bits) return {};
  const auto name = signal.value_names.find(RawInteger(signal, *bits));
  return name == signal.value_names.end() ? std::string() : name->second;
}

/// A cell that may hold commas and quotes.
std::string Quoted(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c == '\n' || c == '\r' ? ' ' : c;
  }
  return quoted + '"';
}

/// A row of the CSV file that has one for each value.
std::string Row(const CandumpRecord& record,
                const DecodedMessage& decoded,
                const DbcSignal& signal,
                long double value,
                const std::string& verdict) {
  return fmt::format("{},{},{},{},{},{},{}\n",
                     record.time_ns,
                     decoded.message->name,
                     signal.name,
                     FormatValue(signal, value),
                     Quoted(signal.unit),
                     Quoted(ValueName(signal, record.frame.payload())),
                     verdict == "valid" && !std::isfinite(value) ? "not_finite" : verdict);
}

void Decode(const CandumpRecord& record, bool wide, DecodedMessage& decoded, std::string& rows) {
  const std::string verdict = VerdictName(decoded.guard.Judge(record.frame).verdict);
  const bool is_valid = verdict == "valid";
  if (decoded.guard.counters().frames == 1) decoded.first_ns = record.time_ns;
  decoded.last_ns = record.time_ns;
  if (wide) rows += fmt::format("{},{}", record.time_ns, verdict);
  for (DecodedSignal& signal : decoded.signals) {
    const auto payload = record.frame.payload();
    std::optional<long double> value;
    if (IsPresent(*decoded.message, *signal.signal, payload))
      value = DecodeExactly(*signal.signal, payload);
    if (wide) rows += value ? "," + FormatValue(*signal.signal, *value) : ",";
    if (!value) continue;
    if (!wide) rows += Row(record, decoded, *signal.signal, *value, verdict);
    if (is_valid) signal.Add(*value, ValueName(*signal.signal, payload));
  }
  if (wide) rows += '\n';
}

std::string Header(const Options& options, const Decoder& decoder) {
  if (!options.wide) return "time_ns,message,signal,value,unit,name,validity\n";
  std::string header = "time_ns,validity";
  for (const DecodedSignal& signal : decoder.begin()->second.signals)
    header += "," + signal.signal->name;
  return header + "\n";
}

/// The frames of the log, and those of which no message was asked for.
struct Passed {
  std::int64_t frames = 0;
  std::int64_t other_frames = 0;
  std::int64_t dataless_frames = 0;  ///< Remote or error frames.
};

Result<Passed> DecodeLog(const Options& options, Decoder& decoder, std::string& rows) {
  auto log = CandumpLog::Open(options.can);
  if (!log) return std::move(log).error();
  Passed passed;
  while (true) {
    auto record = log->Next();
    if (!record) return std::move(record).error();
    if (!record->has_value()) break;
    const CandumpRecord& frame = **record;
    if (!options.interface.empty() && frame.interface != options.interface) continue;
    ++passed.frames;
    if (frame.frame.error || frame.frame.remote) {
      ++passed.dataless_frames;
      continue;
    }
    const auto decoded = decoder.find(frame.frame.id);
    if (decoded == decoder.end()) {
      ++passed.other_frames;
      continue;
    }
    Decode(frame, options.wide, decoded->second, rows);
  }
  if (const std::string left_out = log->LeftOut(); !left_out.empty()) {
    fmt::print(stderr, "reloc can decode: {}\n", left_out);
  }
  return passed;
}

void Print(const DecodedSignal& decoded) {
  const DbcSignal& signal = *decoded.signal;
  const std::string refused =
      decoded.not_finite == 0 ? "" : fmt::format("; not finite {}", decoded.not_finite);
  if (decoded.values == 0) {
    fmt::print("  {:<28} no value{}\n", signal.name, refused);
    return;
  }
  fmt::print("  {:<28} {:>14} min {:>14.6g} mean {:>14} max {:>14} last {}{}{}\n",
             signal.name,
             FormatValue(signal, decoded.minimum),
             static_cast<double>(decoded.sum / static_cast<long double>(decoded.values)),
             FormatValue(signal, decoded.maximum),
             FormatValue(signal, decoded.last),
             signal.unit,
             decoded.last_name.empty() ? "" : " (" + decoded.last_name + ")",
             refused);
}

void Print(const DecodedMessage& decoded) {
  const MessageGuard::Counters& counts = decoded.guard.counters();
  const double duration_s = static_cast<double>(decoded.last_ns - decoded.first_ns) * 1e-9;
  const double rate_hz =
      duration_s > 0.0 ? static_cast<double>(counts.frames - 1) / duration_s : 0.0;
  fmt::print(
      "{} (0x{:X}{}): {} frames, {:.1f} Hz; bad checksums {}, stuck counters {}, short {}, "
      "missing {}\n",
      decoded.message->name,
      decoded.message->id.value,
      decoded.message->id.extended ? ", 29 bits" : "",
      counts.frames,
      rate_hz,
      counts.bad_checksums,
      counts.stuck_counters,
      counts.short_frames,
      counts.missing_frames);
  for (const DecodedSignal& signal : decoded.signals)
    Print(signal);
}

Result<void> RunDecode(const Options& options) {
  const auto sources = ReadSources(options);
  if (!sources) return sources.error();
  auto decoder = MakeDecoder(options, *sources);
  if (!decoder) return std::move(decoder).error();
  std::string rows = Header(options, *decoder);
  const auto passed = DecodeLog(options, *decoder, rows);
  if (!passed) return passed.error();
  const bool any = std::any_of(decoder->begin(), decoder->end(), [](const auto& entry) {
    return entry.second.guard.counters().frames > 0;
  });
  if (!any) {
    return Invalid(fmt::format("{}: has none of the {} messages that are asked for in {} frames{}",
                               options.can,
                               decoder->size(),
                               passed->frames,
                               options.interface.empty() ? "" : " of " + options.interface));
  }
  if (!options.out.empty()) {
    if (auto ok = WriteFileAtomically(options.out, rows); !ok) return ok;
  }
  for (const auto& [id, decoded] : *decoder) {
    if (decoded.guard.counters().frames > 0) Print(decoded);
  }
  fmt::print("{} frames, {} of other messages, {} remote or error frames\n",
             passed->frames,
             passed->other_frames,
             passed->dataless_frames);
  return {};
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  CLI::App app(
      "What is said on a recorded CAN bus.\n\n"
      "decode reads a candump log with a DBC file, prints each message with its rate and faults, "
      "and each signal with its range, and writes all values as CSV. Signals that a multiplexor "
      "leaves out of a frame have no row; values that are not finite have one that says so, and "
      "are "
      "counted, not in the ranges. With --config the rules of can.messages (counter, "
      "checksum) tell which frames are valid; those that are not are in the CSV file, named, and "
      "not in the ranges.",
      "reloc can");
  app.require_subcommand(1);
  relocd::Options options;
  CLI::App& decode = *app.add_subcommand("decode", "signals of a candump log by a DBC file");
  decode.add_option("--dbc", options.dbc, "the DBC file; without it the config's can.dbc_file");
  decode.add_option("--config", options.config, "YAML file with can.messages: counters, checksums");
  decode.add_option("--set", options.overrides, "section.key=value, put over the config's")
      ->needs("--config")
      ->allow_extra_args(false);
  decode.add_option("--can", options.can, "what candump -L wrote")->required();
  decode.add_option("--interface", options.interface, "only its frames, such as can0");
  decode.add_option("--message", options.messages, "only this message; may be repeated")
      ->allow_extra_args(false);
  decode.add_option("--signal", options.signals, "only this MESSAGE.SIGNAL; may be repeated")
      ->allow_extra_args(false);
  decode.add_option("--out", options.out, "CSV: time_ns,message,signal,value,unit,name,validity");
  decode.add_flag("--wide", options.wide, "CSV of one message: a row a frame, a column a signal");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (auto ok = relocd::RunDecode(options); !ok) {
    fmt::print(stderr, "reloc can decode: {}\n", ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
