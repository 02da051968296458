#include "simulation/smooth_trajectory.h"

#include <algorithm>
#include <cstddef>
#include <iterator>

#include "geometry/angle.h"

namespace relocd {

SmoothTrajectory::SmoothTrajectory(const Trajectory2& X_WBs) {
  for (const TimedPose2& pose : X_WBs) {
    double heading = pose.X_WB.yaw();
    if (!knots_.empty()) {
      const double before = knots_.back().value.z();
      heading = before + WrapAngle(heading - before);
    }
    knots_.push_back({.time_ns = pose.time_ns, .value = {pose.X_WB.x(), pose.X_WB.y(), heading}});
  }
  const std::size_t last = knots_.size() - 1;
  for (std::size_t i = 0; i <= last; ++i) {
    const Knot& before = knots_[i == 0 ? 0 : i - 1];
    const Knot& after = knots_[std::min(i + 1, last)];
    knots_[i].rate =
        (after.value - before.value) / (static_cast<double>(after.time_ns - before.time_ns) * 1e-9);
  }
}

Pose2 SmoothTrajectory::At(std::int64_t time_ns) const {
  time_ns = std::clamp(time_ns, begin_ns(), end_ns());
  auto after = std::upper_bound(
      knots_.begin() + 1, knots_.end() - 1, time_ns, [](std::int64_t time, const Knot& knot) {
        return time < knot.time_ns;
      });
  const Knot& to = *after;
  const Knot& from = *std::prev(after);
  const double span_s = static_cast<double>(to.time_ns - from.time_ns) * 1e-9;
  const double s = static_cast<double>(time_ns - from.time_ns) * 1e-9 / span_s;
  // The four cubic Hermite polynomials.
  const double from_value = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s);
  const double from_rate = s * (1.0 - s) * (1.0 - s) * span_s;
  const double to_value = s * s * (3.0 - 2.0 * s);
  const double to_rate = s * s * (s - 1.0) * span_s;
  const Eigen::Vector3d value =
      from_value * from.value + from_rate * from.rate + to_value * to.value + to_rate * to.rate;
  return {value.x(), value.y(), value.z()};
}

}  // namespace relocd
