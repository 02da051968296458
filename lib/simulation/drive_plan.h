#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/result.h"
#include "geometry/pose2.h"
#include "simulation/session.h"
#include "simulation/smooth_path.h"
#include "simulation/speed_profile.h"
#include "simulation/world.h"

namespace relocd {

/// How a route is driven.
struct DrivePlanOptions {
  std::uint64_t seed = 0;  ///< Of swaying, of small changes of speed, and of how long stops last.
  double speed_mps = 7.0;  ///< On a straight, before the session's factor.
  double lateral_acceleration_mps2 = 2.0;  ///< In bends, at most.
  SpeedProfile::Limits limits{};
  double begin_m = 0.0;              ///< Along the route, from its first point.
  std::optional<double> end_m{};     ///< Nothing: a closed route's begin, an open one's end.
  int laps = 1;                      ///< Closed routes: how often the end is reached.
  std::vector<double> stops_m{};     ///< Along the route; on each pass.
  double stop_s = 3.0;               ///< Stops last so long, up to half more or less.
  std::vector<double> reverses_m{};  ///< Places where it stops, and reverses for a while.
  double reverse_m = 5.0;            ///< How far.
};

/// A drive along a route: where the body is at each time, without error.
///
/// The body's origin moves along its x axis, forwards or backwards, and never sideways; velocity
/// and acceleration do not jump. It stands for a second at the begin and at the end. The same
/// options give the same drive. Immutable, hence thread-safe.
class DrivePlan {
 public:
  struct State {
    Pose2 X_WB;
    double heading_rad = 0.0;        ///< Of X_WB, but continuous, not wrapped.
    double travel_m = 0.0;           ///< Of B's origin in the plane, less when going backwards.
    double speed_mps = 0.0;          ///< Negative: backwards.
    double acceleration_mps2 = 0.0;  ///< Along x.
    double curvature_per_m = 0.0;    ///< Of the path, positive to the left.
    [[nodiscard]] double yaw_rate_radps() const { return speed_mps * curvature_per_m; }
    [[nodiscard]] double lateral_acceleration_mps2() const { return speed_mps * yaw_rate_radps(); }
  };

  /// @return kInvalidInput for an option out of range, or a route that is too short, or turns more
  ///         sharply than a vehicle can.
  static Result<DrivePlan> Create(const Path& route,
                                  const Session& session,
                                  const DrivePlanOptions& options);

  [[nodiscard]] std::int64_t duration_ns() const;

  /// At a time since the begin.
  [[nodiscard]] State At(std::int64_t time_ns) const;

  /// Of the path that is driven; what is driven twice counts once.
  [[nodiscard]] double length_m() const { return path_.length_m(); }

 private:
  DrivePlan(SmoothPath path, SpeedProfile profile)
      : path_(std::move(path)), profile_(std::move(profile)) {}

  SmoothPath path_;
  SpeedProfile profile_;
};

}  // namespace relocd
