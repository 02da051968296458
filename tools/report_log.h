#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/result.h"

namespace relocd {

/// How long something took.
struct ReportedLatency {
  std::string key;   ///< For scripts: `can_to_pose`.
  std::string name;  ///< For people, with where the number is from.
  double p50_ms = 0.0;
  double p99_ms = 0.0;
};

/// What a drive's log says beyond its poses.
struct LogFacts {
  std::vector<std::int64_t> image_times_ns;  ///< From the time origin, as recorded.
  std::vector<ReportedLatency> latencies;    ///< Those that there are.
  std::int64_t messages = 0;
  std::int64_t lost = 0;
};

/// @param time_origin_ns  taken off the images' mono_ns.
/// @return kUnavailable when the log cannot be read; kInvalidInput when it holds no message.
Result<LogFacts> ReadLogFacts(const std::string& path, std::int64_t time_origin_ns);

/// The images (as JPEG) that were taken at these times, in their order; empty where there is none.
Result<std::vector<std::string>> ReadLogImages(const std::string& path,
                                               std::int64_t time_origin_ns,
                                               const std::vector<std::int64_t>& times_ns);

}  // namespace relocd
