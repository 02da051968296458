#include "recording/recorder_config.h"

#include <fmt/format.h>

namespace relocd {

Result<void> RecorderConfig::Validate() const {
  constexpr int kMaxSegmentMb = 4096;
  constexpr double kMaxFlushS = 60.0;
  const auto invalid = [](const std::string& message) {
    return Error{ErrorKind::kInvalidInput, message};
  };
  if (directory.empty()) return invalid("directory is empty, must name a folder");
  if (segment_mb < 1 || segment_mb > kMaxSegmentMb) {
    return invalid(fmt::format("segment_mb is {}, must be in [1, {}]", segment_mb, kMaxSegmentMb));
  }
  if (max_total_mb < segment_mb) {
    return invalid(fmt::format(
        "max_total_mb is {}, must be at least segment_mb, which is {}", max_total_mb, segment_mb));
  }
  if (min_free_mb < 0) {
    return invalid(fmt::format("min_free_mb is {}, must not be negative", min_free_mb));
  }
  if (!(flush_s > 0.0) || flush_s > kMaxFlushS) {
    return invalid(fmt::format("flush_s is {}, must be in (0, {}]", flush_s, kMaxFlushS));
  }
  return {};
}

}  // namespace relocd
