#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ostream>
#include <vector>

namespace relocd {

struct ErrorStatistics {
  double mean = 0.0;
  double rmse = 0.0;
  double median = 0.0;
  double max = 0.0;
};

/// Of at least one error.
inline ErrorStatistics Summarize(std::vector<double> errors) {
  ErrorStatistics statistics;
  for (const double error : errors) {
    statistics.mean += error / static_cast<double>(errors.size());
    statistics.rmse += error * error / static_cast<double>(errors.size());
  }
  statistics.rmse = std::sqrt(statistics.rmse);
  std::sort(errors.begin(), errors.end());
  statistics.median = errors[errors.size() / 2];
  statistics.max = errors.back();
  return statistics;
}

inline std::ostream& operator<<(std::ostream& stream, const ErrorStatistics& statistics) {
  return stream << "mean " << statistics.mean << " rmse " << statistics.rmse << " median "
                << statistics.median << " max " << statistics.max;
}

}  // namespace relocd
