#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "can/can_source.h"
#include "core/playback_epoch.h"
#include "daemon/daemon.h"
#include "odometryd/odometry_node.h"

namespace relocd {
namespace {

constexpr int kWarning = 4;  // syslog's
constexpr int kNotice = 5;
constexpr Duration kTickPeriod = std::chrono::milliseconds(10);
constexpr Duration kRetryPeriod = std::chrono::milliseconds(100);

Result<WheelOdometry> MakeOdometry(const Config& config) {
  if (config.can.dbc_file.empty()) {
    return Error{ErrorKind::kInvalidInput, "can.dbc_file is empty, must name a DBC file"};
  }
  auto dbc = DbcFile::Read(config.can.dbc_file);
  if (!dbc) return Error{ErrorKind::kInvalidInput, dbc.error().message};
  return WheelOdometry::Create(config.odometry, *dbc, config.can.messages);
}

/// A source of CAN frames, opened again whenever it is lost, and the node.
class OdometryDaemon final : public Daemon {
 public:
  static Result<std::unique_ptr<Daemon>> Make(DaemonContext& context) {
    auto odometry = MakeOdometry(context.config);
    if (!odometry) return std::move(odometry).error();
    std::unique_ptr<OdometryDaemon> daemon(
        new OdometryDaemon(context, std::move(odometry).value()));
    if (auto ok = daemon->Start(); !ok) return std::move(ok).error();
    return std::unique_ptr<Daemon>(std::move(daemon));
  }

  NodeStatus Status(const ClockReading& now) override { return node_.Status(now); }

 private:
  OdometryDaemon(DaemonContext& context, WheelOdometry odometry)
      : loop_(context.loop),
        source_(MakeCanSource(
            context.config.can, odometry.ids(), PlaybackEpoch(MonotonicClock::now()))),
        node_(context.config.can, std::move(odometry), context.control_bus, context.run_id) {}

  Result<void> Start() {
    auto opened = TryOpen();
    if (!opened && opened.error().kind == ErrorKind::kInvalidInput) return opened;
    if (auto ok = loop_.Every(kRetryPeriod, [this] { Reopen(); }); !ok) return ok;
    return loop_.Every(kTickPeriod, [this] {
      HandleSource();
      node_.Tick(ReadClocks());
    });
  }

  /// The bus may come later than this process, and go and come again.
  Result<void> TryOpen() {
    auto ok = source_->Open();
    if (ok) ok = loop_.OnReadable(source_->fd(), [this] { HandleSource(); });
    node_.HandleSourceError(ok ? "" : ok.error().message);
    if (ok && std::exchange(is_lost_, false)) {
      LogLine(kNotice, "odometryd", fmt::format("{} is there again", source_->description()));
    }
    return ok;
  }

  void Reopen() {
    if (!source_->is_open()) static_cast<void>(TryOpen().has_value());  // the status tells of it
  }

  void HandleSource() {
    if (!source_->is_open()) return;
    frames_.clear();
    while (true) {
      auto frame = source_->Receive();
      if (!frame) {
        Lost(frame.error().message);
        break;
      }
      if (!frame->has_value()) break;
      frames_.push_back(**frame);
    }
    const ClockReading now = ReadClocks();
    node_.HandleBusStatus(source_->status(), now);
    node_.HandleFrames(frames_, now);
  }

  void Lost(const std::string& error) {
    LogLine(kWarning, "odometryd", error);
    is_lost_ = true;
    node_.HandleSourceError(error);
  }

  EventLoop& loop_;
  std::unique_ptr<CanSource> source_;
  OdometryNode node_;
  bool is_lost_ = false;          ///< It was open before.
  std::vector<CanFrame> frames_;  ///< Kept between calls, so that receiving does not allocate.
};

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  return relocd::RunDaemon(argc,
                           argv,
                           {.name = "odometryd",
                            .description = "Turns the wheels' CAN frames into ODOMETRY.",
                            .uses_images = false,
                            .instance_option = {}},
                           relocd::OdometryDaemon::Make);
}
