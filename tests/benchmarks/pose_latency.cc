#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <span>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "core/exit_code.h"
#include "core/file.h"
#include "core/parse_number.h"
#include "core/result.h"
#include "core/time.h"
#include "core/unique_fd.h"
#include "geometry/planar.h"
#include "messaging/bounded_decode.h"
#include "messaging/lcm_bus.h"
#include "runtime/event_loop.h"
#include "smoothing/offline_smoother.h"
#include "supervision/child_process.h"
#include "support/camera_pose_message.h"

// pose_latency: how long it takes from an ODOMETRY message to its POSE, between processes and over
// LCM, while fixes are solved for. To be run in tests/integration/in_network.

namespace relocd {
namespace {

struct Options {
  std::string smootherd;
  std::string config;
  std::string url = "udpm://239.255.76.67:7667?ttl=0";
  double seconds = 60.0;
  double odometry_hz = 100.0;
  double fix_hz = 10.0;
  int priority = 0;
  bool is_floor = false;
  bool is_echo = false;
  double largest_p99_ms = 0.0;
};

/// So much of the drive is sent at once before anything is measured: then the window is full.
constexpr double kWarmUp = 60.0;   // s
constexpr double kSpeed = 10.0;    // m/s: a keyframe, and a fix, each metre
constexpr double kYawRate = 0.05;  // rad/s
constexpr std::int64_t kRunId = 11;
/// A message that had no answer for so long has none.
constexpr std::int64_t kLost = -1;
/// A fix is sent at most so long before the odometry that it shall be in the way of.
constexpr int kLongestLead = 100;  // us

/// What odometryd and inferenced say of a drive with 10 m/s in a wide circle.
class Drive {
 public:
  Drive(MonotonicTime start, double odometry_hz)
      : time_(start), period_(FromSeconds(1.0 / odometry_hz)) {}

  odometry_t NextOdometry() {
    const double seconds = ToSeconds(period_);
    const Pose2 motion = Pose2::Exp({kSpeed * seconds, 0.0, kYawRate * seconds});
    odometry_t message{};
    message.prev_mono_ns = ToNanoseconds(time_);
    time_ += period_;
    X_WB_ = X_WB_ * motion;
    message.mono_ns = ToNanoseconds(time_);
    message.utime = message.mono_ns / 1000;  // nobody else listens: it is how the answer is known
    message.seq = odometry_seq_++;
    message.run_id = kRunId;
    message.dx_m = motion.x();
    message.dy_m = motion.y();
    message.dtheta_rad = motion.yaw();
    Eigen::Map<Eigen::Matrix3d>(message.motion_covariance) =
        MakeOdometryStep({}, period_, motion, {}).covariance;
    message.x_OB_m = X_WB_.x();
    message.y_OB_m = X_WB_.y();
    message.yaw_OB_rad = X_WB_.yaw();
    message.speed_mps = kSpeed;
    message.yaw_rate_radps = kYawRate;
    return message;
  }

  /// A camera that saw it 50 ms ago, with an outlier in ten.
  camera_pose_t NextFix() {
    const double sigma_m = ++fixes_ % 10 == 0 ? 5.0 : 0.1;
    const Pose2 error(sigma_m * normal_(engine_), sigma_m * normal_(engine_), 0.0);
    const Pose2 back = Pose2::Exp({kSpeed * -0.05, 0.0, kYawRate * -0.05});
    camera_pose_t message = CameraPoseMessage(LiftFromPlane(X_WB_ * back * error) * X_BC());
    message.mono_ns = ToNanoseconds(time_) - 50'000'000;
    message.utime = message.mono_ns / 1000;
    message.seq = fixes_;
    message.run_id = kRunId;
    return message;
  }

  /// The camera of config/vehicles/differential_demo.yaml.
  static Pose3 X_BC() {
    const double half_pi = 0.5 * std::numbers::pi;
    return {RotationFromRollPitchYaw(-half_pi, 0.0, -half_pi), {1.03, 0.0, 1.65}};
  }

 private:
  MonotonicTime time_;
  Duration period_;
  Pose2 X_WB_;
  std::int64_t odometry_seq_ = 0;
  std::int64_t fixes_ = 0;
  std::mt19937 engine_{1};
  std::normal_distribution<double> normal_{0.0, 1.0};
};

/// One ODOMETRY message of the measured part.
struct Sent {
  std::int64_t utime = 0;
  std::int64_t realtime_ns = 0;
  bool is_behind_a_fix = false;
  std::int64_t sent_back_ns = kLost;  ///< Until the POSE was sent.
  std::int64_t received_ns = kLost;   ///< Until this process had it from LCM.
};

/// The network, heard beside LCM: the kernel stamps a datagram when its sender has sent it, so that
/// it does not matter how long this process takes to wake up.
class WireTap {
 public:
  struct Heard {
    std::int64_t utime = 0;        ///< Of the POSE.
    std::int64_t realtime_ns = 0;  ///< When it was sent.
  };

  /// @param url  as LcmBus::Open takes it.
  static Result<WireTap> Open(const std::string& url) {
    sockaddr_in group{};
    group.sin_family = AF_INET;
    const std::string address = url.substr(url.find("//") + 2);
    const auto port = ParseInt64(address.substr(address.find(':') + 1, 4)).value_or(0);
    group.sin_port = htons(static_cast<std::uint16_t>(port));
    ip_mreq membership{};
    const std::string host = address.substr(0, address.find(':'));
    static_cast<void>(::inet_pton(AF_INET, host.c_str(), &group.sin_addr));
    membership.imr_multiaddr = group.sin_addr;
    WireTap tap(UniqueFd(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)));
    const bool is_open =
        tap.Set(SOL_SOCKET, SO_REUSEADDR, 1) && tap.Set(SOL_SOCKET, SO_REUSEPORT, 1) &&
        tap.Set(SOL_SOCKET, SO_TIMESTAMPNS, 1) &&
        tap.Set(IPPROTO_IP, IP_ADD_MEMBERSHIP, membership) &&
        ::bind(tap.fd_.get(), reinterpret_cast<const sockaddr*>(&group), sizeof(group)) == 0;
    if (is_open) return tap;
    return Error{ErrorKind::kUnavailable,
                 fmt::format("listening at '{}': {}", url, std::generic_category().message(errno))};
  }

  [[nodiscard]] int fd() const { return fd_.get(); }

  /// The next POSE that waits.
  std::optional<Heard> Next() {
    std::array<std::uint8_t, 65536> buffer{};
    alignas(cmsghdr) std::array<char, 256> control{};
    iovec data{.iov_base = buffer.data(), .iov_len = buffer.size()};
    while (true) {
      msghdr header{};
      header.msg_iov = &data;
      header.msg_iovlen = 1;
      header.msg_control = control.data();
      header.msg_controllen = control.size();
      const ssize_t size = ::recvmsg(fd_.get(), &header, 0);
      if (size < 0) return std::nullopt;
      const std::span<const std::uint8_t> bytes(buffer.data(), static_cast<std::size_t>(size));
      if (const auto utime = PoseIn(bytes)) return Heard{*utime, StampOf(header)};
    }
  }

 private:
  explicit WireTap(UniqueFd fd) : fd_(std::move(fd)) {}

  template <typename Value>
  bool Set(int level, int option, const Value& value) {
    return ::setsockopt(fd_.get(), level, option, &value, sizeof(value)) == 0;
  }

  /// LCM's short message: "LC02", a number, the channel's name, zero, the message.
  static std::optional<std::int64_t> PoseIn(std::span<const std::uint8_t> bytes) {
    constexpr std::size_t kHeader = 8;
    const std::string name = channels::kPose.name;
    const std::size_t begin = kHeader + name.size() + 1;
    if (bytes.size() < begin || !std::equal(name.begin(), name.end(), bytes.begin() + kHeader) ||
        bytes[begin - 1] != 0) {
      return std::nullopt;
    }
    const auto pose = DecodeBounded<pose_t>(bytes.subspan(begin));
    return pose ? std::optional(pose->utime) : std::nullopt;
  }

  static std::int64_t StampOf(msghdr& header) {
    for (cmsghdr* item = CMSG_FIRSTHDR(&header); item != nullptr;
         item = CMSG_NXTHDR(&header, item)) {
      if (item->cmsg_level != SOL_SOCKET || item->cmsg_type != SCM_TIMESTAMPNS) continue;
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(item), sizeof(stamp));
      return stamp.tv_sec * 1'000'000'000 + stamp.tv_nsec;
    }
    return 0;
  }

  UniqueFd fd_;
};

std::int64_t RealtimeNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// What all processors of the machine have done since they started.
struct CpuTimes {
  double busy = 0.0;
  double all = 0.0;

  static CpuTimes Read() {
    CpuTimes times;
    const auto stat = ReadFile("/proc/stat");
    std::istringstream text(stat ? *stat : "");
    std::string name;
    text >> name;  // user nice system idle iowait irq softirq steal
    std::array<double, 8> columns{};
    for (double& column : columns)
      text >> column;
    for (const double column : columns)
      times.all += column;
    times.busy = times.all - columns[3] - columns[4];
    return times;
  }
};

/// Drives before smootherd, and looks at what comes back.
class Meter {
 public:
  Meter(const Options& options, EventLoop& loop, LcmBus& bus, WireTap& tap)
      : options_(options),
        loop_(loop),
        bus_(bus),
        tap_(tap),
        drive_(MonotonicClock::now() - FromSeconds(kWarmUp), options.odometry_hz),
        ticks_per_fix_(std::max(1L, std::lround(options.odometry_hz / options.fix_hz))) {
    sent_.reserve(static_cast<std::size_t>(options.seconds * options.odometry_hz) + 1);
    bus.Subscribe<pose_t>(channels::kPose, Delivery::kEvery, [this](const pose_t& pose) {
      const std::int64_t now_ns = RealtimeNs();
      if (Sent* sent = Find(pose.utime)) sent->received_ns = now_ns - sent->realtime_ns;
    });
  }

  Result<void> Run() {
    WarmUp();
    bus_.HandlePending();
    before_ = CpuTimes::Read();
    auto ok = loop_.OnReadable(tap_.fd(), [this] { HandleTap(); });
    if (!ok) return ok;
    ok = loop_.Every(FromSeconds(1.0 / options_.odometry_hz), [this] { Tick(); });
    return ok ? loop_.Run() : ok;
  }

  /// @return the p99 of all, in milliseconds; nothing when a message had no answer.
  std::optional<double> Report() {
    const CpuTimes after = CpuTimes::Read();
    const auto load = ReadFile("/proc/loadavg");
    fmt::print("processors busy {:.0f} % of the time; load {}",
               100.0 * (after.busy - before_.busy) / std::max(1.0, after.all - before_.all),
               load ? *load : "unknown\n");
    const auto behind_a_fix = [](const Sent& sent) { return sent.is_behind_a_fix; };
    const auto any = [](const Sent&) { return true; };
    const double p99_ms = Print("ODOMETRY sent to POSE sent", &Sent::sent_back_ns, any);
    Print("  right behind a fix", &Sent::sent_back_ns, behind_a_fix);
    Print("ODOMETRY sent to POSE received", &Sent::received_ns, any);
    Print("  right behind a fix", &Sent::received_ns, behind_a_fix);
    const auto lost = std::count_if(
        sent_.begin(), sent_.end(), [](const Sent& sent) { return sent.sent_back_ns == kLost; });
    fmt::print("without an answer: {} of {}\n", lost, sent_.size());
    if (lost > 0) return std::nullopt;
    return p99_ms;
  }

 private:
  void WarmUp() {
    const auto messages = static_cast<int>(kWarmUp * options_.odometry_hz);
    for (int i = 0; i < messages; ++i) {
      static_cast<void>(bus_.Publish(channels::kOdometry, drive_.NextOdometry()).has_value());
      if (i % ticks_per_fix_ == 0) PublishFix();
      SpinFor(std::chrono::microseconds(300));  // a reader's buffer has an end
    }
  }

  void Tick() {
    if (static_cast<double>(sent_.size()) >= options_.seconds * options_.odometry_hz) {
      // The last answers come while this waits.
      if (++idle_ticks_ > 20) loop_.Stop();
      return;
    }
    const bool has_fix = ++ticks_ % ticks_per_fix_ == 0;
    if (has_fix) {
      PublishFix();
      // So that odometry comes before, in and after the solution.
      SpinFor(std::chrono::microseconds(engine_() % kLongestLead));
    }
    const odometry_t message = drive_.NextOdometry();
    sent_.push_back(
        {.utime = message.utime, .realtime_ns = RealtimeNs(), .is_behind_a_fix = has_fix});
    static_cast<void>(bus_.Publish(channels::kOdometry, message).has_value());
  }

  void PublishFix() {
    static_cast<void>(bus_.Publish(channels::kCameraPose, drive_.NextFix()).has_value());
  }

  static void SpinFor(Duration duration) {
    const MonotonicTime end = MonotonicClock::now() + duration;
    while (MonotonicClock::now() < end) {
    }
  }

  void HandleTap() {
    while (const auto heard = tap_.Next()) {
      Sent* sent = Find(heard->utime);
      if (sent != nullptr) sent->sent_back_ns = heard->realtime_ns - sent->realtime_ns;
    }
  }

  /// Null for one of the warm-up.
  Sent* Find(std::int64_t utime) {
    const auto sent =
        std::lower_bound(sent_.begin(), sent_.end(), utime, [](const Sent& s, std::int64_t t) {
          return s.utime < t;
        });
    return sent == sent_.end() || sent->utime != utime ? nullptr : &*sent;
  }

  /// @return the p99 in milliseconds.
  template <typename Choose>
  double Print(const char* name, std::int64_t Sent::*latency_ns, const Choose& choose) const {
    std::vector<double> latencies_ms;
    for (const Sent& sent : sent_) {
      if (sent.*latency_ns != kLost && choose(sent))
        latencies_ms.push_back(static_cast<double>(sent.*latency_ns) * 1e-6);
    }
    if (latencies_ms.empty()) return 0.0;
    std::sort(latencies_ms.begin(), latencies_ms.end());
    const auto at = [&latencies_ms](double share) {
      return latencies_ms[static_cast<std::size_t>(share *
                                                   static_cast<double>(latencies_ms.size() - 1))];
    };
    fmt::print("{:<30} {:6} messages, p50 {:.3f}, p90 {:.3f}, p99 {:.3f}, max {:.3f} ms\n",
               name,
               latencies_ms.size(),
               at(0.5),
               at(0.9),
               at(0.99),
               at(1.0));
    return at(0.99);
  }

  const Options& options_;
  EventLoop& loop_;
  LcmBus& bus_;
  WireTap& tap_;
  Drive drive_;
  std::int64_t ticks_per_fix_;
  std::int64_t ticks_ = 0;
  int idle_ticks_ = 0;
  std::vector<Sent> sent_;
  CpuTimes before_;
  std::mt19937 engine_{2};
};

/// In place of smootherd: answers at once, so that what is measured is LCM and the kernel.
Result<void> Echo(EventLoop& loop, LcmBus& bus) {
  bus.Subscribe<odometry_t>(
      channels::kOdometry, Delivery::kEvery, [&bus](const odometry_t& message) {
        pose_t pose{};
        pose.utime = message.utime;
        static_cast<void>(bus.Publish(channels::kPose, pose).has_value());
      });
  auto ok = loop.Every(std::chrono::milliseconds(100), [&bus] {
    static_cast<void>(bus.Publish(StatusChannel("smootherd"), status_t{}).has_value());
  });
  return ok ? loop.Run() : ok;
}

/// Until the other process has said something.
Result<void> WaitForStatus(LcmBus& bus) {
  // The subscription lives as long as the bus, and so longer than this function.
  const auto seen = std::make_shared<bool>(false);
  bus.Subscribe<status_t>(
      StatusChannel("smootherd"), Delivery::kNewest, [seen](const status_t&) { *seen = true; });
  constexpr int kTenths = 100;
  for (int i = 0; i < kTenths && !*seen; ++i) {
    pollfd readable{.fd = bus.fd(), .events = POLLIN, .revents = 0};
    static_cast<void>(::poll(&readable, 1, 100));
    bus.HandlePending();
  }
  if (*seen) return {};
  return Error{ErrorKind::kUnavailable, "waiting for STATUS_smootherd: none came in 10 s"};
}

/// The program to measure, running.
Result<ChildProcess> StartChild(const Options& options, const std::string& self) {
  LaunchOptions launch{.command = {options.smootherd,
                                   "--config",
                                   options.config,
                                   "--lcm-url",
                                   options.url,
                                   "--set",
                                   "localization.state_file="},
                       .is_real_time = options.priority > 0,
                       .priority = options.priority};
  if (options.is_floor) launch.command = {self, "--echo", "--lcm-url", options.url};
  auto child = ChildProcess::Start(launch);
  if (child && !child->warning().empty()) fmt::print("{}\n", child->warning());
  return child;
}

Result<void> Judge(const std::optional<double>& p99_ms, double largest_ms) {
  if (!p99_ms) return Error{ErrorKind::kInternal, "messages had no answer"};
  if (largest_ms == 0.0 || *p99_ms <= largest_ms) return {};
  return Error{ErrorKind::kInternal,
               fmt::format("the p99 is {:.3f} ms, must be at most {}", *p99_ms, largest_ms)};
}

Result<void> Run(const Options& options, const std::string& self) {
  auto loop = EventLoop::Create();
  if (!loop) return std::move(loop).error();
  auto bus = LcmBus::Open(options.url);
  if (!bus) return std::move(bus).error();
  auto ok = loop->OnReadable((*bus)->fd(), [&bus] { (*bus)->HandlePending(); });
  if (!ok) return ok;
  if (options.is_echo) return Echo(*loop, **bus);

  auto child = StartChild(options, self);
  if (!child) return std::move(child).error();
  if (ok = WaitForStatus(**bus); !ok) return ok;
  auto tap = WireTap::Open(options.url);
  if (!tap) return std::move(tap).error();
  Meter meter(options, *loop, **bus, *tap);
  if (ok = meter.Run(); !ok) return ok;
  return Judge(meter.Report(), options.largest_p99_ms);
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  relocd::Options options;
  CLI::App app("How long it takes from an ODOMETRY message to its POSE, over LCM.", "pose_latency");
  app.add_option("--smootherd", options.smootherd, "the program to measure");
  app.add_option("--config", options.config, "smootherd's; with a camera called front");
  app.add_option("--lcm-url", options.url, "of the control network")->capture_default_str();
  app.add_option("--seconds", options.seconds, "to measure for")->capture_default_str();
  app.add_option("--odometry-hz", options.odometry_hz)->capture_default_str();
  app.add_option("--fix-hz", options.fix_hz)->capture_default_str();
  app.add_option("--priority", options.priority, "SCHED_FIFO for smootherd, as relocd starts it");
  app.add_option("--max-p99-ms", options.largest_p99_ms, "above it, exit with 1");
  app.add_flag("--floor", options.is_floor, "measure LCM alone: a process that answers at once");
  app.add_flag("--echo", options.is_echo, "be that process");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  if (auto ok = relocd::Run(options, argv[0]); !ok) {
    fmt::print(stderr, "pose_latency: {}\n", ok.error().message);
    return relocd::ExitCode(ok.error());
  }
  return relocd::kExitOk;
}
