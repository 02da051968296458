#pragma once

#include <functional>
#include <vector>

namespace relocd {

/// Where along a path a vehicle is at each time: as fast as it may, with a velocity and an
/// acceleration that do not jump.
///
/// Immutable, hence thread-safe.
class SpeedProfile {
 public:
  /// A part of the drive without a stop: forwards where `to_m` is larger, else backwards.
  struct Leg {
    double from_m = 0.0;  ///< Where the leg before ended.
    double to_m = 0.0;
    double pause_s = 0.0;  ///< How long it stands after it, at least kLeastPauseS.
  };
  struct Limits {
    double acceleration_mps2 = 1.2;
    double braking_mps2 = 1.6;
    double reverse_speed_mps = 1.5;
  };
  struct State {
    double distance_m = 0.0;
    double speed_mps = 0.0;  ///< Negative: backwards.
    double acceleration_mps2 = 0.0;
  };

  /// Acceleration takes so long to build up fully.
  static constexpr double kSmoothingS = 0.6;
  static constexpr double kLeastPauseS = 2.0 * kSmoothingS;

  /// @param pause_s  how long it stands before the first leg.
  /// @param speed_limit_mps  at a distance, positive; looked at every 0.1 m, and kept there.
  SpeedProfile(double pause_s,
               const std::vector<Leg>& legs,
               const std::function<double(double distance_m)>& speed_limit_mps,
               const Limits& limits);

  [[nodiscard]] double duration_s() const { return knots_.back().time_s; }

  /// At a time since the begin; before it stands at the begin, later at the end.
  [[nodiscard]] State At(double time_s) const;

 private:
  /// Between knots the acceleration is constant. It jumps at them, and At gives the average over
  /// kSmoothingS, in which nothing does.
  struct Knot {
    double time_s = 0.0;
    double distance_m = 0.0;
    double speed_mps = 0.0;
    double integral_ms = 0.0;  ///< Of the distance over time.
  };

  void Drive(const Leg& leg, const std::vector<double>& speeds_mps);
  void Stand(double duration_s);
  /// The profile at any time, without the average.
  [[nodiscard]] Knot Sharp(double time_s) const;

  std::vector<Knot> knots_;
};

}  // namespace relocd
