#include "messaging/stream_monitor.h"

namespace relocd {
namespace {

/// Weeks of messages at 1 kHz: numbers further apart are no loss.
constexpr std::uint64_t kMostLost = std::uint64_t{1} << 32;

}  // namespace

void StreamMonitor::Observe(const StreamPosition& position) {
  if (!last_) {
    last_ = position;
    return;
  }
  if (position.run_id != last_->run_id) {
    if (replaced_run_id_ == position.run_id) {
      ++counters_.conflicts;  // its numbers say nothing while the two alternate
    } else {
      ++counters_.restarts;
    }
    replaced_run_id_ = last_->run_id;
    last_ = position;
    return;
  }
  if (position.seq <= last_->seq) {
    ++counters_.repeated;
    return;
  }
  // Unsigned: any two numbers may stand in messages, and their difference may need 64 bits.
  const std::uint64_t lost =
      static_cast<std::uint64_t>(position.seq) - static_cast<std::uint64_t>(last_->seq) - 1;
  if (lost <= kMostLost) {
    counters_.lost += static_cast<std::int64_t>(lost);
  } else {
    ++counters_.restarts;
  }
  last_ = position;
}

}  // namespace relocd
