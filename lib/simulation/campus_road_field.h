#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "simulation/campus_lines.h"

namespace relocd {

/// A line at which the distance to the road has one value; the road lies on its left.
struct RoadContour {
  PlaneLine points;
  bool is_closed = false;
};

/// Where road is, and how far from it everything else: signed distances on a grid of 1 m, from
/// which the road's surface, its kerbs and its sidewalks follow. Streets are put together with
/// rounded corners.
class RoadField {
 public:
  static constexpr double kFarAway = 30.0;  ///< Distances are at most this, m.

  /// Covers the rectangle from `low` to `high`, in whole metres, without any road.
  RoadField(const Eigen::Vector2i& low, const Eigen::Vector2i& high);

  /// Adds what is within `half_width_m` of the line. Concave corners with what is there already are
  /// rounded with `corner_radius_m`.
  void AddStrip(std::span<const Eigen::Vector2d> line, double half_width_m, double corner_radius_m);

  /// Metres to the road; negative inside. kFarAway outside of the grid.
  [[nodiscard]] double DistanceAt(const Eigen::Vector2d& p_W) const;

  /// The direction in which the distance grows.
  [[nodiscard]] Eigen::Vector2d AwayFromRoad(const Eigen::Vector2d& p_W) const;

  /// The lines where the distance is `level_m`, of the triangles into which the grid is cut from
  /// the lower left to the upper right corner of each cell.
  [[nodiscard]] std::vector<RoadContour> Contours(double level_m) const;

  [[nodiscard]] const Eigen::Vector2i& low() const { return low_; }
  [[nodiscard]] const Eigen::Vector2i& high() const { return high_; }

  /// The distance at a point of the grid, which must be within it.
  [[nodiscard]] double NodeDistance(int x, int y) const { return distances_[NodeIndex(x, y)]; }

 private:
  [[nodiscard]] std::size_t NodeIndex(int x, int y) const {
    return static_cast<std::size_t>((y - low_.y()) * columns_ + (x - low_.x()));
  }

  Eigen::Vector2i low_;
  Eigen::Vector2i high_;
  int columns_ = 0;
  std::vector<double> distances_;
};

}  // namespace relocd
