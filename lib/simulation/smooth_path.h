#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace relocd {

/// A curve in the plane whose direction and curvature do not jump: a uniform cubic B-spline, known
/// by the distance along it.
///
/// Immutable, hence thread-safe.
class SmoothPath {
 public:
  struct Point {
    Eigen::Vector2d p_W = Eigen::Vector2d::Zero();
    double heading_rad = 0.0;      ///< Of the direction; continuous along the path, not wrapped.
    double curvature_per_m = 0.0;  ///< Positive to the left.
  };

  /// @param controls  at least four. The curve passes near all but the first and the last of them,
  ///                  and begins and ends near the second and the last but one.
  explicit SmoothPath(std::vector<Eigen::Vector2d> controls);

  [[nodiscard]] double length_m() const { return pieces_.back().end_m; }

  /// At a distance from the begin, which is clamped to the path.
  [[nodiscard]] Point At(double distance_m) const;

  /// The distance that belongs to a place counted in control points: 0 near the second one.
  [[nodiscard]] double DistanceAt(double control) const;

 private:
  /// A part so short that its length is known to rounding from a few points.
  struct Piece {
    double begin = 0.0;  ///< In control points.
    double end = 0.0;
    double begin_m = 0.0;
    double end_m = 0.0;
    double heading_rad = 0.0;  ///< At its begin.
  };
  struct Derivatives {
    Eigen::Vector2d value, first, second;
  };

  [[nodiscard]] Derivatives Evaluate(double control) const;
  [[nodiscard]] double LengthBetween(double begin, double end) const;
  [[nodiscard]] double ControlAt(const Piece& piece, double distance_m) const;

  std::vector<Eigen::Vector2d> controls_;
  std::vector<Piece> pieces_;
};

}  // namespace relocd
