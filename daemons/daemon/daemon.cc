#include "daemon/daemon.h"

#include <sys/random.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

#include <fmt/core.h>

#include "core/exit_code.h"
#include "core/file.h"
#include "core/parse_number.h"
#include "daemon/daemon_options.h"
#include "messaging/lcm_bus.h"

namespace relocd {
namespace {

constexpr Duration kStatusPeriod = std::chrono::seconds(1);
constexpr int kPriorityError = 3;
constexpr int kPriorityNotice = 5;

/// What surrounds the daemon: publishes its status, feeds the watchdog, hands on messages.
class Frame {
 public:
  Frame(const Config& config, const DaemonInfo& info, const DaemonOptions& options)
      : config_(config),
        name_(info.instance_option.empty() ? info.name : info.name + "_" + options.instance),
        instance_(options.instance),
        config_hash_(ConfigHash(config)),
        run_id_(RandomRunId()),
        service_manager_(ServiceManager::FromEnvironment()) {}

  Result<void> Run(const DaemonInfo& info,
                   const std::function<Result<std::unique_ptr<Daemon>>(DaemonContext&)>& make) {
    auto loop = EventLoop::Create();
    if (!loop) return std::move(loop).error();
    if (auto ok = OpenBus(config_.bus.control_url, control_bus_); !ok) return ok;
    if (info.uses_images) {
      if (auto ok = OpenBus(config_.bus.image_url, image_bus_); !ok) return ok;
    }
    DaemonContext context{.config = config_,
                          .loop = *loop,
                          .control_bus = *control_bus_,
                          .image_bus = image_bus_.get(),
                          .service_manager = service_manager_,
                          .run_id = run_id_,
                          .instance = instance_};
    auto daemon = make(context);
    if (!daemon) return std::move(daemon).error();
    for (LcmBus* bus : {control_bus_.get(), image_bus_.get()}) {
      if (auto ok = Follow(bus, *loop); !ok) return ok;
    }
    if (auto ok = StartTimers(*loop, **daemon); !ok) return ok;
    service_manager_.Ready();
    PublishStatus(**daemon);
    auto ran = loop->Run();
    service_manager_.Stopping();
    (*daemon)->Stop(ReadClocks());
    return ran;
  }

 private:
  static Result<void> OpenBus(const std::string& url, std::unique_ptr<LcmBus>& bus) {
    auto opened = LcmBus::Open(url);
    if (!opened) return std::move(opened).error();
    bus = std::move(opened).value();
    return {};
  }

  /// A daemon that only publishes is not woken by the messages of all others, its own included.
  static Result<void> Follow(LcmBus* bus, EventLoop& loop) {
    if (bus == nullptr || !bus->is_listening()) return {};
    if (auto ok = bus->CheckListening(); !ok) return ok;
    return loop.OnReadable(bus->fd(), [bus] { bus->HandlePending(); });
  }

  Result<void> StartTimers(EventLoop& loop, Daemon& daemon) {
    if (const auto period = service_manager_.WatchdogPeriod()) {
      auto ok = loop.Every(*period, [this] { service_manager_.Watchdog(); });
      if (!ok) return ok;
    }
    return loop.Every(kStatusPeriod, [this, &daemon] { PublishStatus(daemon); });
  }

  void PublishStatus(Daemon& daemon) {
    const ClockReading now = ReadClocks();
    NodeStatus status = daemon.Status(now);
    AddChannelCounters(*control_bus_, status);
    if (image_bus_) AddChannelCounters(*image_bus_, status);
    status.Add("resident_bytes", static_cast<double>(ResidentBytes()));

    status_t message{};
    message.utime = now.realtime_us;
    message.mono_ns = ToNanoseconds(now.monotonic);
    message.seq = status_seq_++;
    message.run_id = run_id_;
    message.daemon = name_;
    message.level = status.level;
    message.message = status.message;
    message.version = RELOCD_VERSION;
    message.config_hash = config_hash_;
    for (const StatusValue& value : status.values) {
      status_value_t field{};
      field.name = value.name;
      field.value = value.value;
      message.values.push_back(std::move(field));
    }
    message.n = static_cast<std::int32_t>(message.values.size());
    // A status that does not go out is missed by nobody but the screen: the next one comes in a
    // second.
    static_cast<void>(control_bus_->Publish(StatusChannel(name_), message).has_value());
    service_manager_.Status(status.message.empty() ? "ok" : status.message);
    LogChange(status);
  }

  void LogChange(const NodeStatus& status) {
    if (status.level == last_level_) return;
    LogLine(status.level == status_t::OK ? kPriorityNotice : kPriorityNotice - status.level,
            name_,
            status.level == status_t::OK ? "ok again" : status.message);
    last_level_ = status.level;
  }

  const Config& config_;
  std::string name_;
  std::string instance_;
  std::string config_hash_;
  std::int64_t run_id_;
  std::int64_t status_seq_ = 0;
  int last_level_ = status_t::OK;
  ServiceManager service_manager_;
  std::unique_ptr<LcmBus> control_bus_;
  std::unique_ptr<LcmBus> image_bus_;
};

/// Says why the daemon ends, on stderr and to who started it, so that `reloc status` can show it.
int Refuse(const std::string& name, const Error& error) {
  LogLine(kPriorityError, name, error.message);
  ServiceManager::FromEnvironment().Status(error.message);
  return ExitCode(error);
}

}  // namespace

int RunDaemon(int argc,
              char** argv,
              const DaemonInfo& info,
              const std::function<Result<std::unique_ptr<Daemon>>(DaemonContext&)>& make) {
  DaemonOptions options;
  if (const auto exit_code = ParseCommandLine(argc, argv, info, options)) return *exit_code;
  const auto config = LoadConfig(options.config_path, options.overrides);
  if (!config) {
    return Refuse(info.name, config.error());
  }
  if (options.print_config) fmt::print("{}", FormatConfig(*config));
  if (options.check_config || options.print_config) return kExitOk;

  if (auto ok = Frame(*config, info, options).Run(info, make); !ok) {
    return Refuse(info.name, ok.error());
  }
  return kExitOk;
}

void LogLine(int priority, const std::string& daemon, const std::string& text) {
  // Not fmt::print, which throws where nobody takes the log: a full disk must not end a daemon.
  const std::string line = fmt::format("<{}>{}: {}\n", priority, daemon, text);
  static_cast<void>(std::fwrite(line.data(), 1, line.size(), stderr));
}

std::int64_t RandomRunId() {
  std::uint64_t bits = 0;
  if (::getrandom(&bits, sizeof(bits), 0) != static_cast<ssize_t>(sizeof(bits))) {
    bits = static_cast<std::uint64_t>(ToNanoseconds(MonotonicClock::now())) ^
           static_cast<std::uint64_t>(::getpid()) << 48;
  }
  return static_cast<std::int64_t>(bits >> 1);  // positive, so that people can read it
}

std::int64_t ResidentBytes() {
  const auto text = ReadFile("/proc/self/statm");
  if (!text) return 0;
  const auto space = text->find(' ');
  const auto pages = ParseInt64(text->substr(space + 1, text->find(' ', space + 1) - space - 1));
  return pages.value_or(0) * ::sysconf(_SC_PAGESIZE);
}

}  // namespace relocd
