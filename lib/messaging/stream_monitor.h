#pragma once

#include <cstdint>
#include <optional>

namespace relocd {

/// Where a message stands in its publisher's stream.
struct StreamPosition {
  std::int64_t seq = 0;     ///< 0, 1, 2, ... within a run.
  std::int64_t run_id = 0;  ///< Random per start of the publisher.
};

/// Counts, from the positions of the messages that came, those that did not.
class StreamMonitor {
 public:
  struct Counters {
    std::int64_t lost = 0;      ///< Skipped numbers within a run.
    std::int64_t repeated = 0;  ///< Numbers that came again, or late.
    std::int64_t restarts = 0;  ///< The publisher started anew, or leapt in its numbers.
    std::int64_t conflicts =
        0;  ///< Messages of a run that another had followed: two publish on one channel.
  };

  void Observe(const StreamPosition& position);

  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  Counters counters_;
  std::optional<StreamPosition> last_;
  std::optional<std::int64_t> replaced_run_id_;
};

}  // namespace relocd
