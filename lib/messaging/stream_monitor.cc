#include "messaging/stream_monitor.h"

namespace relocd {

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
  counters_.lost += position.seq - last_->seq - 1;
  last_ = position;
}

}  // namespace relocd
