#pragma once

#include <chrono>
#include <cstdint>

namespace relocd {

/// CLOCK_MONOTONIC, as V4L2 stamps its frames: the only clock that crosses a library's boundary.
///
/// Readings of another clock (SocketCAN stamps with CLOCK_REALTIME) are converted where they enter.
using MonotonicClock = std::chrono::steady_clock;
using Duration = std::chrono::nanoseconds;
using MonotonicTime = std::chrono::time_point<MonotonicClock, Duration>;

inline std::int64_t ToNanoseconds(MonotonicTime time) {
  return time.time_since_epoch().count();
}
inline MonotonicTime FromNanoseconds(std::int64_t time_ns) {
  return MonotonicTime(Duration(time_ns));
}
inline Duration FromSeconds(double seconds) {
  return Duration(static_cast<std::int64_t>(seconds * 1e9));
}
inline double ToSeconds(Duration duration) {
  return static_cast<double>(duration.count()) * 1e-9;
}

/// Both clocks, read together: what a message's `mono_ns` and `utime` come from. Daemons read one
/// for each event they handle, a replay makes them from the log.
struct ClockReading {
  MonotonicTime monotonic{};
  std::int64_t realtime_us = 0;  ///< CLOCK_REALTIME, us since 1970.

  /// CLOCK_REALTIME, in us, at another monotonic time near this reading.
  [[nodiscard]] std::int64_t RealtimeUsAt(MonotonicTime time) const {
    return realtime_us -
           std::chrono::duration_cast<std::chrono::microseconds>(monotonic - time).count();
  }
};

inline ClockReading ReadClocks() {
  const auto realtime = std::chrono::system_clock::now().time_since_epoch();
  return {.monotonic = MonotonicClock::now(),
          .realtime_us = std::chrono::duration_cast<std::chrono::microseconds>(realtime).count()};
}

}  // namespace relocd
