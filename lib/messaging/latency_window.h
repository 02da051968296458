#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace relocd {

/// The last few hundred of a series of latencies, for their percentiles.
class LatencyWindow {
 public:
  void Add(double latency) {
    values_[next_] = latency;
    next_ = (next_ + 1) % values_.size();
    size_ = std::min(size_ + 1, values_.size());
  }

  /// The smallest value that `share` (in [0, 1]) of the window does not exceed; 0 when it is empty.
  [[nodiscard]] double Percentile(double share) const {
    if (size_ == 0) return 0.0;
    std::array<double, kSize> sorted = values_;
    const auto rank = std::lround(share * static_cast<double>(size_ - 1));
    const auto nth = sorted.begin() + rank;
    std::nth_element(sorted.begin(), nth, sorted.begin() + static_cast<std::ptrdiff_t>(size_));
    return *nth;
  }

 private:
  static constexpr std::size_t kSize = 512;
  std::array<double, kSize> values_{};
  std::size_t next_ = 0;
  std::size_t size_ = 0;
};

}  // namespace relocd
