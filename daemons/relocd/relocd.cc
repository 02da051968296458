#include "relocd/relocd.h"

#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "relocd/config_sections.h"
#include "relocd/instance_lock.h"

#include "core/file.h"
#include "core/playback_epoch.h"
#include "daemon/daemon.h"

namespace relocd {
namespace {

constexpr int kError = 3;
constexpr int kNotice = 5;
constexpr Duration kTickPeriod = std::chrono::milliseconds(250);
constexpr Duration kBusRetryPeriod = std::chrono::seconds(1);

void Log(int priority, const std::string& text) {
  LogLine(priority, "relocd", text);
}

/// Where the children's programs are: beside this one.
std::string ProgramDirectory() {
  std::error_code error;
  const auto path = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? "." : path.parent_path().string();
}

/// The directory for the lock: systemd's RuntimeDirectory= where there is one.
std::string RuntimeDirectory() {
  // Read before any thread is started that could change the environment.
  const char* directory = ::secure_getenv("RUNTIME_DIRECTORY");
  return directory == nullptr ? "/tmp" : directory;
}

/// Ours, but for what was said to us alone, and with what is the same for all children.
std::vector<std::string> ChildEnvironment(MonotonicTime playback_epoch) {
  constexpr std::array<std::string_view, 4> kOurs{
      "NOTIFY_SOCKET=", "WATCHDOG_USEC=", "WATCHDOG_PID=", "RELOCD_PLAYBACK_EPOCH_NS="};
  std::vector<std::string> environment;
  for (char** entry = ::environ; entry != nullptr && *entry != nullptr; ++entry) {
    const std::string_view text = *entry;
    const bool is_ours = std::any_of(
        kOurs.begin(), kOurs.end(), [&](std::string_view name) { return text.starts_with(name); });
    if (!is_ours) environment.emplace_back(text);
  }
  environment.push_back(fmt::format("RELOCD_PLAYBACK_EPOCH_NS={}", ToNanoseconds(playback_epoch)));
  return environment;
}

SupervisorOptions OptionsOf(const SupervisionConfig& config) {
  const MonotonicTime now = MonotonicClock::now();
  return {
      .backoff_initial = FromSeconds(config.backoff_initial_s),
      .backoff_max = FromSeconds(config.backoff_max_s),
      .backoff_reset = FromSeconds(config.backoff_reset_s),
      .environment = ChildEnvironment(PlaybackEpoch(now + FromSeconds(config.playback_delay_s))),
      .on_event = Log};
}

}  // namespace

Relocd::Relocd(Config config, DaemonOptions options)
    : config_(std::move(config)),
      options_(std::move(options)),
      program_directory_(ProgramDirectory()),
      service_manager_(ServiceManager::FromEnvironment()),
      node_(Effective(), RandomRunId()) {}

Result<void> Relocd::Run() {
  // Made before LCM starts a thread: what forks has one thread and no signal of ours unblocked.
  auto lock = InstanceLock::Take(RuntimeDirectory(), config_.bus.control_url);
  if (!lock) return std::move(lock).error();
  if (auto ok = Prepare(); !ok) return ok;

  started_ = MonotonicClock::now();
  supervisor_->Apply(Table(), started_);
  Turn();
  OpenBus();
  Tick();
  if (auto ok = loop_->Run(); !ok) return ok;

  Log(kNotice, "stopping");
  service_manager_.Stopping();
  is_stopping_ = true;
  supervisor_->Stop(MonotonicClock::now());
  if (!supervisor_->has_stopped()) {
    if (auto ok = loop_->Run(); !ok) return ok;
  }
  if (!supervisor_->has_stopped()) Log(kNotice, "asked twice to stop: killing what still runs");
  return {};
}

Result<void> Relocd::Prepare() {
  auto loop = EventLoop::Create();
  if (!loop) return std::move(loop).error();
  loop_.emplace(std::move(loop).value());
  auto supervisor = Supervisor::Create(OptionsOf(config_.supervisor));
  if (!supervisor) return std::move(supervisor).error();
  supervisor_.emplace(std::move(supervisor).value());
  if (auto ok = loop_->OnReadable(supervisor_->fd(), [this] { Turn(); }); !ok) return ok;
  if (auto ok = HookSignals(); !ok) return ok;
  return StartTimers();
}

Result<void> Relocd::HookSignals() {
  sigset_t mask;
  ::sigemptyset(&mask);
  ::sigaddset(&mask, SIGHUP);
  if (::pthread_sigmask(SIG_BLOCK, &mask, nullptr) != 0) {
    return SystemError(ErrorKind::kInternal, "blocking SIGHUP");
  }
  hangup_ = UniqueFd(::signalfd(-1, &mask, SFD_NONBLOCK | SFD_CLOEXEC));
  if (!hangup_.valid()) return SystemError(ErrorKind::kInternal, "creating a signalfd");
  return loop_->OnReadable(hangup_.get(), [this] {
    signalfd_siginfo taken{};
    if (::read(hangup_.get(), &taken, sizeof(taken)) > 0) Reload();
  });
}

Result<void> Relocd::StartTimers() {
  if (const auto period = service_manager_.WatchdogPeriod()) {
    auto ok = loop_->Every(*period, [this] { service_manager_.Watchdog(); });
    if (!ok) return ok;
  }
  if (auto ok = loop_->Every(kBusRetryPeriod, [this] { OpenBus(); }); !ok) return ok;
  return loop_->Every(kTickPeriod, [this] { Tick(); });
}

void Relocd::OpenBus() {
  if (bus_ != nullptr && bus_url_ == config_.bus.control_url) return;
  bus_.reset();
  auto bus = LcmBus::Open(config_.bus.control_url);
  if (!bus) return ReportBusTrouble(bus.error().message);
  // Nothing is subscribed to, so its fd is not watched: the bus only publishes.
  bus_ = std::move(bus).value();
  bus_url_ = config_.bus.control_url;
}

void Relocd::Turn() {
  const std::int64_t before = supervisor_->changes();
  supervisor_->Handle(MonotonicClock::now());
  if (supervisor_->changes() != before) Tick();
  if (is_stopping_ && supervisor_->has_stopped()) loop_->Stop();
}

void Relocd::Tick() {
  const ClockReading now = ReadClocks();
  const auto reports = supervisor_->Reports(now.monotonic);
  if (auto ok = node_.Publish(bus_.get(), reports, supervisor_->changes(), now); !ok) {
    ReportBusTrouble(ok.error().message);
  } else if (bus_ != nullptr) {
    ReportBusTrouble("");
  }
  service_manager_.Status(Summarize(reports));

  const double patience_s = std::max(config_.supervisor.odometryd.start_timeout_s,
                                     config_.supervisor.smootherd.start_timeout_s);
  const bool has_waited = now.monotonic - started_ >= FromSeconds(patience_s);
  if (!is_ready_ && (has_waited || IsEssentialReady(reports))) {
    is_ready_ = true;
    service_manager_.Ready();
    Log(kNotice, "ready: " + Summarize(reports));
  }
}

void Relocd::Reload() {
  if (is_stopping_) return;
  auto config = LoadConfig(options_.config_path, options_.overrides);
  if (!config) {
    return Log(kError, "reload: " + config.error().message + "; the config stays as it was");
  }
  config_ = std::move(config).value();
  Log(kNotice, "reload: config " + ConfigHash(config_));
  node_.SetConfig(Effective());
  supervisor_->SetBackoff(FromSeconds(config_.supervisor.backoff_initial_s),
                          FromSeconds(config_.supervisor.backoff_max_s),
                          FromSeconds(config_.supervisor.backoff_reset_s));
  supervisor_->Apply(Table(), MonotonicClock::now());
  OpenBus();
  Tick();
}

std::vector<ProcessSpec> Relocd::Table() const {
  const ConfigSections sections(config_);
  ProcessTableContext context{.cameras = sections.CameraNames(),
                              .program_directory = program_directory_,
                              .arguments = {"--config", options_.config_path}};
  for (const std::string& text : options_.overrides)
    context.arguments.insert(context.arguments.end(), {"--set", text});
  auto table = MakeProcessTable(config_.supervisor, context);
  for (ProcessSpec& spec : table)
    spec.settings = sections.ReadBy(spec.name);
  return table;
}

EffectiveConfig Relocd::Effective() const {
  return {.version = RELOCD_VERSION, .hash = ConfigHash(config_), .yaml = FormatConfig(config_)};
}

void Relocd::ReportBusTrouble(const std::string& trouble) {
  if (trouble == bus_trouble_) return;
  if (trouble.empty()) {
    Log(kNotice, "LCM works again");
  } else {
    Log(kError, trouble + " (the daemons run on, tried again each second)");
  }
  bus_trouble_ = trouble;
}

}  // namespace relocd
