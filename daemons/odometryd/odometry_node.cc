#include "odometryd/odometry_node.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "messaging/can_frame_message.h"

namespace relocd {
namespace {

constexpr bool IsSame(OdometryFlag ours, std::int32_t of_message) {
  return static_cast<std::int32_t>(ours) == of_message;
}
static_assert(IsSame(kOdometryStale, odometry_t::FLAG_STALE));
static_assert(IsSame(kOdometryGap, odometry_t::FLAG_GAP));
static_assert(IsSame(kOdometryChecksum, odometry_t::FLAG_CHECKSUM));
static_assert(IsSame(kOdometrySlip, odometry_t::FLAG_SLIP));
static_assert(IsSame(kOdometryJump, odometry_t::FLAG_JUMP));
static_assert(IsSame(kOdometryStandstill, odometry_t::FLAG_STANDSTILL));

/// Rates and ages are over this many messages.
constexpr std::size_t kHistory = 200;
/// Without a measurement for longer, the wheels are said to be silent.
constexpr Duration kSilence = std::chrono::milliseconds(500);
/// For how long after a fault the status tells of it.
constexpr Duration kTroubleShown = std::chrono::seconds(2);
/// A controller that is to restart by itself does so within this time.
constexpr Duration kBusOffPatience = std::chrono::seconds(1);

std::string FlagNames(std::int32_t flags) {
  constexpr std::array<std::pair<std::int32_t, const char*>, 4> kNames = {{
      {kOdometryGap, "measurements missing"},
      {kOdometryChecksum, "bad checksum or counter"},
      {kOdometrySlip, "wheels slip"},
      {kOdometryJump, "implausible measurements"},
  }};
  std::string names;
  for (const auto& [flag, name] : kNames) {
    if ((flags & flag) == 0) continue;
    if (!names.empty()) names += ", ";
    names += name;
  }
  return names;
}

double Milliseconds(Duration duration) {
  return ToSeconds(duration) * 1e3;
}

template <typename Value>
void Remember(std::deque<Value>& history, Value value) {
  history.push_back(value);
  if (history.size() > kHistory) history.pop_front();
}

/// The value below which this part of all are.
Duration Percentile(std::deque<Duration> values, double part) {
  if (values.empty()) return Duration::zero();
  const auto rank = static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

}  // namespace

OdometryNode::OdometryNode(const CanConfig& can,
                           WheelOdometry odometry,
                           MessageBus& bus,
                           std::int64_t run_id)
    : interface_(can.interface),
      can_channel_(CanChannel(can.interface)),
      odometry_(std::move(odometry)),
      bus_(bus),
      run_id_(run_id) {}

void OdometryNode::HandleFrames(std::span<const CanFrame> frames, const ClockReading& now) {
  for (const CanFrame& frame : frames) {
    batch_.push_back(frame);
    HandleFrame(frame, now);
  }
}

void OdometryNode::HandleBusStatus(const CanBusStatus& status, const ClockReading& now) {
  if (status.state != CanBusState::kBusOff) {
    bus_off_since_.reset();
  } else if (!bus_off_since_) {
    bus_off_since_ = now.monotonic;
  }
  bus_status_ = status;
}

void OdometryNode::Handle(const can_frames_t& message) {
  const ClockReading recorded{.monotonic = FromNanoseconds(message.mono_ns),
                              .realtime_us = message.utime};
  for (const can_frame_t& frame : message.frames)
    HandleFrame(FromMessage(frame), recorded);
}

void OdometryNode::HandleFrame(const CanFrame& frame, const ClockReading& now) {
  const auto increment = odometry_.Handle(frame);
  if (odometry_.last_sample()) last_measurement_ = odometry_.last_sample()->time;
  if (increment) PublishOdometry(*increment, now);
}

void OdometryNode::Tick(const ClockReading& now) {
  PublishFrames(now);
  if (const auto guess = odometry_.Tick(now.monotonic)) PublishOdometry(*guess, now);
}

void OdometryNode::PublishOdometry(const OdometryIncrement& increment, const ClockReading& now) {
  odometry_t message{};
  message.utime = now.RealtimeUsAt(increment.time);
  message.mono_ns = ToNanoseconds(increment.time);
  message.seq = odometry_seq_++;
  message.run_id = run_id_;
  message.prev_mono_ns = ToNanoseconds(increment.previous_time);
  message.dx_m = increment.X_BiBj.x();
  message.dy_m = increment.X_BiBj.y();
  message.dtheta_rad = increment.X_BiBj.yaw();
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
      static_cast<double*>(message.motion_covariance)) = increment.covariance;
  message.x_OB_m = increment.X_OB.x();
  message.y_OB_m = increment.X_OB.y();
  message.yaw_OB_rad = increment.X_OB.yaw();
  message.speed_mps = increment.speed_mps;
  message.yaw_rate_radps = increment.yaw_rate_radps;
  message.flags = increment.flags;
  if (increment.ticks) message.ticks.assign(increment.ticks->begin(), increment.ticks->end());
  message.nwheels = static_cast<std::int32_t>(message.ticks.size());
  if (!bus_.Publish(channels::kOdometry, message)) ++publish_failures_;

  Remember(published_, now.monotonic);
  Remember(ages_, now.monotonic - increment.time);
  constexpr std::int32_t kTrouble =
      kOdometryGap | kOdometryChecksum | kOdometrySlip | kOdometryJump;
  if ((increment.flags & kTrouble) == 0) return;
  last_trouble_ = now.monotonic;
  trouble_flags_ = increment.flags & kTrouble;
}

void OdometryNode::PublishFrames(const ClockReading& now) {
  if (batch_.empty() && bus_status_.state == published_state_) return;
  const MonotonicTime time = batch_.empty() ? now.monotonic : batch_.back().receive_time;
  can_frames_t message{};
  message.utime = now.RealtimeUsAt(time);
  message.mono_ns = ToNanoseconds(time);
  message.seq = can_seq_++;
  message.run_id = run_id_;
  message.rx_dropped = bus_status_.dropped;
  message.error_frames = bus_status_.error_frames;
  message.bus_state = static_cast<std::int32_t>(bus_status_.state);
  for (const CanFrame& frame : batch_)
    message.frames.push_back(ToMessage(frame));
  message.n = static_cast<std::int32_t>(message.frames.size());
  if (!bus_.Publish(can_channel_, message)) ++publish_failures_;
  published_state_ = bus_status_.state;
  batch_.clear();
}

NodeStatus OdometryNode::Status(const ClockReading& now) const {
  NodeStatus status;
  RaiseLevel(now, status);
  const WheelOdometry::Counters& counts = odometry_.counters();
  const MessageGuard::Counters frames = odometry_.frame_counters();
  const auto add = [&status](const char* name, auto value) {
    status.Add(name, static_cast<double>(value));
  };
  const auto second_ago = now.monotonic - std::chrono::seconds(1);
  add("odometry_rate_hz", std::count_if(published_.begin(), published_.end(), [&](auto time) {
        return time > second_ago;
      }));
  add("frame_to_odometry_p50_ms", Milliseconds(Percentile(ages_, 0.5)));
  add("frame_to_odometry_p99_ms", Milliseconds(Percentile(ages_, 0.99)));
  add("measurements", counts.samples);
  add("gaps", counts.gaps);
  add("jumps", counts.jumps);
  add("slips", counts.slips);
  add("guesses", counts.guesses);
  add("out_of_order", counts.out_of_order);
  add("clock_jumps", counts.clock_jumps);
  add("bad_checksums", frames.bad_checksums);
  add("stuck_counters", frames.stuck_counters);
  add("short_frames", frames.short_frames);
  add("missing_frames", frames.missing_frames);
  add("non_finite_values", frames.non_finite);
  add("can_received", bus_status_.received);
  add("can_dropped", bus_status_.dropped);
  add("can_error_frames", bus_status_.error_frames);
  add("can_malformed", bus_status_.malformed);
  add("can_bus_state", bus_status_.state);
  add("publish_failures", publish_failures_);
  return status;
}

void OdometryNode::RaiseLevel(const ClockReading& now, NodeStatus& status) const {
  if (!source_error_.empty()) status.Raise(status_t::ERROR, source_error_);
  if (bus_status_.state == CanBusState::kInterfaceDown && source_error_.empty()) {
    status.Raise(status_t::ERROR, fmt::format("{0} is down: ip link set {0} up", interface_));
  }
  if (bus_off_since_ && now.monotonic - *bus_off_since_ > kBusOffPatience) {
    status.Raise(
        status_t::ERROR,
        fmt::format("{0} has been bus off for {1:.0f} s: ip link set {0} down; ip link set "
                    "{0} type can restart-ms 100; ip link set {0} up",
                    interface_,
                    ToSeconds(now.monotonic - *bus_off_since_)));
  }
  if (!last_measurement_) {
    status.Raise(
        status_t::WARNING,
        fmt::format(
            "no wheel measurement yet in {} frames of {}", bus_status_.received, interface_));
  } else if (now.monotonic - *last_measurement_ > kSilence) {
    status.Raise(status_t::ERROR,
                 fmt::format("no wheel measurement for {:.1f} s",
                             ToSeconds(now.monotonic - *last_measurement_)));
  }
  if (publish_failures_ > 0) {
    status.Raise(status_t::WARNING, fmt::format("{} messages not sent", publish_failures_));
  }
  if (last_trouble_ && now.monotonic - *last_trouble_ < kTroubleShown) {
    status.Raise(status_t::WARNING, FlagNames(trouble_flags_));
  }
}

}  // namespace relocd
