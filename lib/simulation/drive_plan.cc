#include "simulation/drive_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <numbers>
#include <random>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

/// Between the control points of the path that is driven: corners of the route are rounded over
/// about so much, which moves a bend of 6 m radius by 6 cm.
constexpr double kControlSpacingM = 1.5;
constexpr double kShortestM = 5.0;
constexpr double kLeastRadiusM = 2.0;  // of a small car
/// How long it stands at the begin and at the end; the first and the last part of the profile's
/// pause are taken by smoothing.
constexpr double kStandS = 1.0 + SpeedProfile::kSmoothingS;

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

/// A sum of waves along the way, in [-1, 1].
class Waves {
 public:
  Waves(double shortest_m, double longest_m, std::mt19937_64& engine) {
    std::uniform_real_distribution<double> uniform;
    for (Wave& wave : waves_) {
      wave.length_m = shortest_m * std::pow(longest_m / shortest_m, uniform(engine));
      wave.phase_rad = 2.0 * std::numbers::pi * uniform(engine);
    }
  }

  [[nodiscard]] double At(double distance_m) const {
    double sum = 0.0;
    for (const Wave& wave : waves_)
      sum += std::sin(2.0 * std::numbers::pi * distance_m / wave.length_m + wave.phase_rad);
    return sum / static_cast<double>(waves_.size());
  }

 private:
  struct Wave {
    double length_m = 1.0;
    double phase_rad = 0.0;
  };
  std::array<Wave, 3> waves_;
};

/// Points along a route, at any distance from its begin: a curve through all of its points.
class RouteCurve {
 public:
  explicit RouteCurve(const Path& route) : points_(route.points), is_closed_(route.is_closed) {
    // A closed route may repeat its first point at the end, or not.
    constexpr double kSamePlaceM = 1e-6;
    const auto is_near = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
      return (a - b).norm() < kSamePlaceM;
    };
    points_.erase(std::unique(points_.begin(), points_.end(), is_near), points_.end());
    if (is_closed_ && points_.size() > 1 && is_near(points_.front(), points_.back()))
      points_.pop_back();
    const std::size_t count = points_.size() + (is_closed_ ? 1 : 0);
    for (std::size_t i = 0; i < count; ++i) {
      const double step_m = i == 0 ? 0.0 : (points_[i % points_.size()] - points_[i - 1]).norm();
      distances_m_.push_back(i == 0 ? 0.0 : distances_m_.back() + step_m);
    }
  }

  [[nodiscard]] std::size_t size() const { return points_.size(); }
  [[nodiscard]] double length_m() const { return distances_m_.empty() ? 0.0 : distances_m_.back(); }

  /// Goes round a closed route, and straight on beyond the ends of an open one.
  [[nodiscard]] Eigen::Vector2d At(double distance_m) const {
    if (is_closed_) {
      distance_m -= length_m() * std::floor(distance_m / length_m());
    } else if (distance_m < 0.0) {
      return points_.front() + distance_m * Slope(0);
    } else if (distance_m > length_m()) {
      return points_.back() + (distance_m - length_m()) * Slope(points_.size() - 1);
    }
    const auto after =
        std::upper_bound(distances_m_.begin() + 1, distances_m_.end() - 1, distance_m);
    const auto from = static_cast<std::size_t>(std::distance(distances_m_.begin(), after)) - 1;
    return Interpolate(from, distance_m);
  }

 private:
  [[nodiscard]] const Eigen::Vector2d& Point(std::size_t i) const {
    return points_[i % points_.size()];
  }

  /// The derivative by the distance, at a point: of the parabola through it and its neighbours.
  [[nodiscard]] Eigen::Vector2d Slope(std::size_t i) const {
    const std::size_t last = points_.size() - 1;
    i %= points_.size();
    if (!is_closed_ && i == 0) return (points_[1] - points_[0]).normalized();
    if (!is_closed_ && i == last) return (points_[last] - points_[last - 1]).normalized();
    const Eigen::Vector2d before = Point(i) - Point(i == 0 ? last : i - 1);
    const Eigen::Vector2d after = Point(i + 1) - Point(i);
    const double before_m = before.norm();
    const double after_m = after.norm();
    return (before * (after_m / before_m) + after * (before_m / after_m)) / (before_m + after_m);
  }

  /// Cubic Hermite interpolation behind a point.
  [[nodiscard]] Eigen::Vector2d Interpolate(std::size_t from, double distance_m) const {
    const double span_m = distances_m_[from + 1] - distances_m_[from];
    const double s = (distance_m - distances_m_[from]) / span_m;
    const double t = 1.0 - s;
    return (1.0 + 2.0 * s) * t * t * Point(from) + s * t * t * span_m * Slope(from) +
           s * s * (3.0 - 2.0 * s) * Point(from + 1) - s * s * t * span_m * Slope(from + 1);
  }

  std::vector<Eigen::Vector2d> points_;
  bool is_closed_;
  std::vector<double> distances_m_;  ///< Of each point, and at last of the end.
};

struct Range {
  double begin_m = 0.0;  ///< Along the route.
  double length_m = 0.0;
};

Result<Range> DrivenRange(const Path& route, double route_m, const DrivePlanOptions& options) {
  const double end_m = options.end_m.value_or(route.is_closed ? options.begin_m : route_m);
  for (const double place_m : {options.begin_m, end_m}) {
    if (!(place_m >= 0.0 && place_m <= route_m)) {
      return Invalid(
          fmt::format("the drive begins or ends at {} m, must be on the route, in [0, {:.1f}]",
                      place_m,
                      route_m));
    }
  }
  if (options.laps < 1 || options.laps > 100) {
    return Invalid(fmt::format("laps is {}, must be in [1, 100]", options.laps));
  }
  double length_m = end_m - options.begin_m;
  if (route.is_closed) {
    if (length_m <= 0.0) length_m += route_m;
    length_m += route_m * (options.laps - 1);
  } else if (options.laps != 1) {
    return Invalid(
        fmt::format("laps is {}, must be 1 on a route that does not close", options.laps));
  }
  if (!(length_m >= kShortestM)) {
    return Invalid(fmt::format("the drive from {} m to {} m has {:.1f} m, must have at least {} m",
                               options.begin_m,
                               end_m,
                               length_m,
                               kShortestM));
  }
  return Range{.begin_m = options.begin_m, .length_m = length_m};
}

Result<void> CheckOptions(const DrivePlanOptions& options, double route_m) {
  struct Field {
    const char* name;
    double value;
    double low;
    double high;
  };
  const SpeedProfile::Limits& limits = options.limits;
  for (const Field& field :
       {Field{"speed_mps", options.speed_mps, 0.1, 50.0},
        Field{"lateral_acceleration_mps2", options.lateral_acceleration_mps2, 0.1, 10.0},
        Field{"acceleration_mps2", limits.acceleration_mps2, 0.1, 10.0},
        Field{"braking_mps2", limits.braking_mps2, 0.1, 10.0},
        Field{"reverse_speed_mps", limits.reverse_speed_mps, 0.1, 5.0},
        Field{"stop_s", options.stop_s, 0.0, 3600.0},
        Field{"reverse_m", options.reverse_m, 0.5, 100.0}}) {
    if (!(field.value >= field.low && field.value <= field.high)) {
      return Invalid(fmt::format(
          "{} is {}, must be in [{}, {}]", field.name, field.value, field.low, field.high));
    }
  }
  for (const auto* places : {&options.stops_m, &options.reverses_m}) {
    for (const double place_m : *places) {
      if (!(place_m >= 0.0 && place_m <= route_m)) {
        return Invalid(
            fmt::format("a stop at {} m, must be on the route, in [0, {:.1f}]", place_m, route_m));
      }
    }
  }
  return {};
}

/// The path of B: the route, moved to the side.
SmoothPath MakePath(const RouteCurve& route,
                    const Range& range,
                    const Session& session,
                    const Waves& sway) {
  const auto spans = static_cast<int>(std::ceil(range.length_m / kControlSpacingM));
  const double spacing_m = range.length_m / spans;
  std::vector<Eigen::Vector2d> controls;
  for (int i = -1; i <= spans + 1; ++i) {
    const double place_m = range.begin_m + spacing_m * i;
    // Over two control points, as the path is no finer.
    const Eigen::Vector2d along =
        (route.At(place_m + spacing_m) - route.At(place_m - spacing_m)).normalized();
    const double left_m =
        session.lateral_offset_m + session.lateral_sway_m * sway.At(spacing_m * i);
    controls.push_back(route.At(place_m) + left_m * Eigen::Vector2d(-along.y(), along.x()));
  }
  return SmoothPath(std::move(controls));
}

Result<void> CheckCurvature(const SmoothPath& path) {
  constexpr double kStepM = 0.2;
  for (double distance_m = 0.0; distance_m < path.length_m(); distance_m += kStepM) {
    const SmoothPath::Point at = path.At(distance_m);
    if (std::abs(at.curvature_per_m) * kLeastRadiusM <= 1.0) continue;  // false for NaN
    return Invalid(
        fmt::format("the drive turns with a radius of {:.2f} m at ({:.1f}, {:.1f}), must be at "
                    "least {} m",
                    1.0 / std::abs(at.curvature_per_m),
                    at.p_W.x(),
                    at.p_W.y(),
                    kLeastRadiusM));
  }
  return {};
}

/// A place on the path where it stands for a while, perhaps after which it reverses.
struct Halt {
  double distance_m = 0.0;
  double reverse_m = 0.0;
};

std::vector<Halt> FindHalts(const SmoothPath& path,
                            const Range& range,
                            double route_m,
                            const DrivePlanOptions& options) {
  std::vector<Halt> halts;
  const double controls = std::ceil(range.length_m / kControlSpacingM);
  const auto add = [&](double place_m, double reverse_m) {
    // On a closed route the place comes once a lap.
    for (double since_m = place_m - range.begin_m; since_m < range.length_m; since_m += route_m) {
      const double distance_m = path.DistanceAt(since_m / range.length_m * controls);
      // There must be room to get going, to stop, and to reverse.
      const double room_m = std::max(1.0, reverse_m);
      if (since_m < 0.0 || distance_m < room_m || distance_m > path.length_m() - 1.0) continue;
      halts.push_back({.distance_m = distance_m, .reverse_m = reverse_m});
    }
  };
  for (const double place_m : options.stops_m)
    add(place_m, 0.0);
  for (const double place_m : options.reverses_m)
    add(place_m, options.reverse_m);
  std::sort(halts.begin(), halts.end(), [](const Halt& a, const Halt& b) {
    return a.distance_m < b.distance_m;
  });
  return halts;
}

std::vector<SpeedProfile::Leg> MakeLegs(const std::vector<Halt>& halts,
                                        double length_m,
                                        double stop_s,
                                        std::mt19937_64& engine) {
  std::vector<SpeedProfile::Leg> legs;
  double at_m = 0.0;
  const auto go = [&](double to_m, double pause_s) {
    constexpr double kNoMoveM = 0.2;
    if (std::abs(to_m - at_m) < kNoMoveM) return;
    pause_s = std::max(pause_s, SpeedProfile::kLeastPauseS);
    legs.push_back({.from_m = at_m, .to_m = to_m, .pause_s = pause_s});
    at_m = to_m;
  };
  std::uniform_real_distribution<double> factor(0.5, 1.5);
  for (const Halt& halt : halts) {
    go(halt.distance_m, stop_s * factor(engine));
    if (halt.reverse_m > 0.0) go(halt.distance_m - halt.reverse_m, 0.0);
  }
  go(length_m, kStandS);
  return legs;
}

}  // namespace

Result<DrivePlan> DrivePlan::Create(const Path& route,
                                    const Session& session,
                                    const DrivePlanOptions& options) {
  const RouteCurve curve(route);
  if (curve.size() < 3) {
    return Invalid(fmt::format("the route has {} points, must have at least 3", curve.size()));
  }
  if (auto ok = CheckOptions(options, curve.length_m()); !ok) return std::move(ok).error();
  auto range = DrivenRange(route, curve.length_m(), options);
  if (!range) return std::move(range).error();

  std::mt19937_64 engine(options.seed);
  const Waves sway(25.0, 80.0, engine);
  const Waves hurry(60.0, 200.0, engine);
  SmoothPath path = MakePath(curve, *range, session, sway);
  if (auto ok = CheckCurvature(path); !ok) return std::move(ok).error();

  const auto speed_limit_mps = [&](double distance_m) {
    constexpr double kHurry = 0.05;
    const double wanted_mps =
        options.speed_mps * session.speed_factor * (1.0 - kHurry * (1.0 + hurry.At(distance_m)));
    // Where it is straight the root is infinite.
    return std::min(wanted_mps,
                    std::sqrt(options.lateral_acceleration_mps2 /
                              std::abs(path.At(distance_m).curvature_per_m)));
  };
  const auto halts = FindHalts(path, *range, curve.length_m(), options);
  const auto legs = MakeLegs(halts, path.length_m(), options.stop_s, engine);
  SpeedProfile profile(kStandS, legs, speed_limit_mps, options.limits);
  return DrivePlan(std::move(path), std::move(profile));
}

std::int64_t DrivePlan::duration_ns() const {
  return std::llround(profile_.duration_s() * 1e9);
}

DrivePlan::State DrivePlan::At(std::int64_t time_ns) const {
  const SpeedProfile::State along = profile_.At(static_cast<double>(time_ns) * 1e-9);
  const SmoothPath::Point point = path_.At(along.distance_m);
  return {.X_WB = Pose2(point.p_W.x(), point.p_W.y(), point.heading_rad),
          .heading_rad = point.heading_rad,
          .travel_m = along.distance_m,
          .speed_mps = along.speed_mps,
          .acceleration_mps2 = along.acceleration_mps2,
          .curvature_per_m = point.curvature_per_m};
}

}  // namespace relocd
