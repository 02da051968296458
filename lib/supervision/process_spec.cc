#include "supervision/process_spec.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace relocd {
namespace {

constexpr double kMaxStopTime = 10.0;  // relocd.service is killed after 15 s

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

bool IsWithin(double value, double low, double high) {
  return value >= low && value <= high;  // false for NaN
}

using NamedProcess = std::pair<std::string, const ProcessConfig*>;

/// The known daemons by name, the consumers first.
std::array<NamedProcess, 5> Daemons(const SupervisionConfig& config) {
  return {{{"recorderd", &config.recorderd},
           {"smootherd", &config.smootherd},
           {"inferenced", &config.inferenced},
           {"odometryd", &config.odometryd},
           {"camerad", &config.camerad}}};
}

std::map<std::string, const ProcessConfig*> AllProcesses(const SupervisionConfig& config) {
  std::map<std::string, const ProcessConfig*> all;
  for (const auto& [name, process] : Daemons(config))
    all[name] = process;
  for (const auto& [name, process] : config.others)
    all.emplace(name, &process);
  return all;
}

Result<void> ValidateNames(const SupervisionConfig& config) {
  const auto is_allowed = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
  };
  const auto daemons = Daemons(config);
  for (const auto& other : config.others) {
    // Not a structured binding: clang does not let a lambda use one.
    const std::string& name = other.first;
    const ProcessConfig& process = other.second;
    if (name.empty() || !std::all_of(name.begin(), name.end(), is_allowed)) {
      return Invalid(
          fmt::format("others: name is '{}', must be of letters, digits, _ and -", name));
    }
    const bool is_daemon = std::any_of(daemons.begin(), daemons.end(), [&](const auto& daemon) {
      return daemon.first == name || name.rfind("camerad_", 0) == 0;
    });
    if (is_daemon) {
      return Invalid(fmt::format("others.{}: is a daemon's name, must be another one", name));
    }
    if (process.command.empty()) {
      return Invalid(fmt::format("others.{}.command is empty, must name a program", name));
    }
  }
  return {};
}

/// Each name that `after` gives is there.
Result<void> ValidateAfter(const std::map<std::string, const ProcessConfig*>& all) {
  for (const auto& [name, process] : all) {
    const std::vector<std::string>& after = process->after;
    const auto unknown = std::ranges::find_if(
        after, [&all](const std::string& other) { return all.count(other) == 0; });
    if (unknown == after.end()) continue;
    std::vector<std::string> names;
    names.reserve(all.size());
    for (const auto& entry : all)
      names.push_back(entry.first);
    return Invalid(
        fmt::format("{}.after names '{}', must be of {}", name, *unknown, fmt::join(names, ", ")));
  }
  return {};
}

/// No one waits for itself in the end.
Result<void> ValidateOrder(const std::map<std::string, const ProcessConfig*>& all) {
  // Takes away those that wait for nobody, until none is left; who is left then is in a circle.
  auto left = all;
  while (!left.empty()) {
    const auto is_left = [&left](const std::string& name) { return left.count(name) != 0; };
    const auto next = std::ranges::find_if(left, [&is_left](const auto& entry) {
      return std::ranges::none_of(entry.second->after, is_left);
    });
    if (next == left.end()) {
      return Invalid(fmt::format("{}.after leads back to {}, must not be a circle",
                                 left.begin()->first,
                                 left.begin()->first));
    }
    left.erase(next);
  }
  return {};
}

Result<void> ValidateStopTime(const std::map<std::string, const ProcessConfig*>& all) {
  std::map<int, double> longest;
  for (const auto& [name, process] : all) {
    double& tier = longest[process->stop_tier];
    if (process->enabled) tier = std::max(tier, process->stop_timeout_s);
  }
  double total = 0.0;
  for (const auto& [tier, timeout] : longest)
    total += timeout;
  if (total <= kMaxStopTime) return {};
  return Invalid(
      fmt::format("stop_timeout_s: the longest ones of all tiers add up to {}, must be "
                  "at most {}",
                  total,
                  kMaxStopTime));
}

ProcessSpec MakeSpec(const NamedProcess& process, const ProcessTableContext& context) {
  ProcessSpec spec{.name = process.first, .config = *process.second, .settings = {}};
  auto& command = spec.config.command;
  if (command.empty()) command = {spec.name};
  if (command.front().find('/') == std::string::npos) {
    command.front() = context.program_directory + "/" + command.front();
  }
  return spec;
}

void AddDaemon(const NamedProcess& daemon,
               const ProcessTableContext& context,
               std::vector<ProcessSpec>& table) {
  ProcessSpec spec = MakeSpec(daemon, context);
  auto& command = spec.config.command;
  command.insert(command.end(), context.arguments.begin(), context.arguments.end());
  if (spec.name != "camerad") {
    table.push_back(std::move(spec));
    return;
  }
  for (const std::string& camera : context.cameras) {
    ProcessSpec one = spec;
    one.name = "camerad_" + camera;
    one.config.command.insert(one.config.command.end(), {"--camera", camera});
    table.push_back(std::move(one));
  }
}

/// Puts the cameras' processes for `camerad`, and drops who is not in the table.
void ResolveAfter(std::vector<ProcessSpec>& table) {
  std::vector<std::string> names;
  names.reserve(table.size());
  for (const ProcessSpec& spec : table)
    names.push_back(spec.name);
  for (ProcessSpec& spec : table) {
    std::vector<std::string> after;
    for (const std::string& name : names) {
      const std::string base = name.rfind("camerad_", 0) == 0 ? "camerad" : name;
      const auto& given = spec.config.after;
      if (std::find(given.begin(), given.end(), base) != given.end()) after.push_back(name);
    }
    spec.config.after = std::move(after);
  }
}

}  // namespace

Result<void> ProcessConfig::Validate() const {
  if (watchdog_s != 0.0 && !IsWithin(watchdog_s, 0.1, 3600.0)) {
    return Invalid(fmt::format("watchdog_s is {}, must be 0 or in [0.1, 3600]", watchdog_s));
  }
  if (!IsWithin(start_timeout_s, 0.1, 3600.0)) {
    return Invalid(fmt::format("start_timeout_s is {}, must be in [0.1, 3600]", start_timeout_s));
  }
  if (!IsWithin(stop_timeout_s, 0.1, kMaxStopTime)) {
    return Invalid(
        fmt::format("stop_timeout_s is {}, must be in [0.1, {}]", stop_timeout_s, kMaxStopTime));
  }
  if (stop_tier < 0 || stop_tier > 9) {
    return Invalid(fmt::format("stop_tier is {}, must be in [0, 9]", stop_tier));
  }
  if (scheduling != "other" && scheduling != "fifo") {
    return Invalid(fmt::format("scheduling is '{}', must be other or fifo", scheduling));
  }
  if (scheduling == "fifo" && (priority < 1 || priority > 99)) {
    return Invalid(
        fmt::format("priority is {}, must be in [1, 99] with scheduling fifo", priority));
  }
  if (scheduling == "other" && priority != 0) {
    return Invalid(fmt::format("priority is {}, must be 0 with scheduling other", priority));
  }
  if (nice < -20 || nice > 19) {
    return Invalid(fmt::format("nice is {}, must be in [-20, 19]", nice));
  }
  if (!IsWithin(rss_limit_mb, 0.0, 1e9)) {
    return Invalid(fmt::format("rss_limit_mb is {}, must be >= 0", rss_limit_mb));
  }
  const bool has_empty = !command.empty() && command.front().empty();
  if (has_empty) return Invalid("command begins with '', must name a program");
  return {};
}

Result<void> SupervisionConfig::Validate() const {
  if (!IsWithin(playback_delay_s, 0.0, 60.0)) {
    return Invalid(fmt::format("playback_delay_s is {}, must be in [0, 60]", playback_delay_s));
  }
  if (!IsWithin(backoff_initial_s, 0.01, 60.0)) {
    return Invalid(
        fmt::format("backoff_initial_s is {}, must be in [0.01, 60]", backoff_initial_s));
  }
  if (!IsWithin(backoff_max_s, backoff_initial_s, 3600.0)) {
    return Invalid(fmt::format("backoff_max_s is {}, must be in [{} (backoff_initial_s), 3600]",
                               backoff_max_s,
                               backoff_initial_s));
  }
  if (!IsWithin(backoff_reset_s, 1e-3, 1e6)) {
    return Invalid(fmt::format("backoff_reset_s is {}, must be > 0", backoff_reset_s));
  }
  if (auto ok = ValidateNames(*this); !ok) return ok;
  for (const auto& [name, process] : Daemons(*this)) {
    if (auto ok = process->Validate(); !ok) {
      return Invalid(fmt::format("{}.{}", name, ok.error().message));
    }
  }
  for (const auto& [name, process] : others) {
    if (auto ok = process.Validate(); !ok) {
      return Invalid(fmt::format("others.{}.{}", name, ok.error().message));
    }
  }
  const auto all = AllProcesses(*this);
  if (auto ok = ValidateAfter(all); !ok) return ok;
  if (auto ok = ValidateOrder(all); !ok) return ok;
  return ValidateStopTime(all);
}

std::vector<ProcessSpec> MakeProcessTable(const SupervisionConfig& config,
                                          const ProcessTableContext& context) {
  std::vector<ProcessSpec> table;
  for (const NamedProcess& daemon : Daemons(config)) {
    if (daemon.second->enabled) AddDaemon(daemon, context, table);
  }
  for (const auto& [name, process] : config.others) {
    if (process.enabled) table.push_back(MakeSpec({name, &process}, context));
  }
  ResolveAfter(table);
  return table;
}

}  // namespace relocd
