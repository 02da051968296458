#include "recorderd/recorder_node.h"

#include <chrono>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

constexpr Duration kToldFor = std::chrono::seconds(5);

}  // namespace

RecorderNode::RecorderNode(const RecorderConfig& config,
                           std::int64_t run_id,
                           SegmentWriter::FreeSpace free_space)
    : segments_(config, fmt::format("{:04x}", run_id & 0xFFFF), std::move(free_space)) {}

void RecorderNode::Handle(const std::string& channel,
                          std::span<const std::uint8_t> bytes,
                          std::int64_t realtime_us) {
  segments_.Append(realtime_us, channel, bytes);
}

NodeStatus RecorderNode::Status(const ClockReading& now) {
  NodeStatus status;
  const auto& counters = segments_.counters();
  if (std::exchange(told_dropped_, counters.dropped) != counters.dropped) {
    dropped_time_ = now.monotonic;
  }
  const bool has_dropped = dropped_time_ && now.monotonic - *dropped_time_ < kToldFor;
  status.Add("events", static_cast<double>(counters.events));
  status.Add("bytes", static_cast<double>(counters.bytes));
  status.Add("dropped_events", static_cast<double>(counters.dropped));
  status.Add("segments_deleted", static_cast<double>(counters.segments_deleted));
  if (has_dropped || !segments_.problem().empty()) {
    status.Raise(status_t::ERROR,
                 fmt::format("{} ({} events dropped)", segments_.last_problem(), counters.dropped));
  }
  return status;
}

}  // namespace relocd
