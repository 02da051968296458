#include "simulation/torcs_lane.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace relocd {
namespace {

using Points = std::vector<Eigen::Vector2d>;

constexpr double kSpacingM = 1.0;
constexpr double kSmoothingSigmaM = 2.0;

/// Points of a closed line evenly spaced along it, near `spacing` apart.
Points Resample(const Points& line, double spacing) {
  std::vector<double> s{0.0};
  for (std::size_t i = 0; i < line.size(); ++i) {
    s.push_back(s.back() + (line[(i + 1) % line.size()] - line[i]).norm());
  }
  const auto count = static_cast<std::size_t>(std::max(3.0, std::round(s.back() / spacing)));
  Points points;
  std::size_t i = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double wanted = s.back() * static_cast<double>(k) / static_cast<double>(count);
    while (i + 1 < line.size() && s[i + 1] <= wanted) {
      ++i;
    }
    const double length = s[i + 1] - s[i];
    const double part = length > 0.0 ? (wanted - s[i]) / length : 0.0;
    points.emplace_back(line[i] + part * (line[(i + 1) % line.size()] - line[i]));
  }
  return points;
}

/// The mean of each point's neighbours along a closed line, weighted by a Gaussian.
Points Smooth(const Points& line, double sigma) {
  const auto reach = std::min(static_cast<std::size_t>(std::ceil(3.0 * sigma)), line.size() / 2);
  Points points;
  for (std::size_t i = 0; i < line.size(); ++i) {
    Eigen::Vector2d sum = line[i];
    double weights = 1.0;
    for (std::size_t k = 1; k <= reach; ++k) {
      const double x = static_cast<double>(k) / sigma;
      const double weight = std::exp(-0.5 * x * x);
      sum += weight * (line[(i + k) % line.size()] + line[(i + line.size() - k) % line.size()]);
      weights += 2.0 * weight;
    }
    points.emplace_back(sum / weights);
  }
  return points;
}

}  // namespace

Path MakeTorcsLane(std::span<const TorcsStation> stations_W, double to_left_m) {
  Points line;
  for (const TorcsStation& station : stations_W.first(stations_W.size() - 1)) {
    const Eigen::Vector2d left(-std::sin(station.yaw_T_rad), std::cos(station.yaw_T_rad));
    line.emplace_back(station.p_T + to_left_m * left);
  }
  const Points even = Resample(line, kSpacingM);
  return {.points = Resample(Smooth(even, kSmoothingSigmaM / kSpacingM), kSpacingM),
          .is_closed = true};
}

Path Reversed(Path path) {
  std::reverse(path.points.begin(), path.points.end());
  return path;
}

}  // namespace relocd
