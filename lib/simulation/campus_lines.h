#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace relocd {

using PlaneLine = std::vector<Eigen::Vector2d>;  ///< Points in W, m, in their order.

/// A corner of a line and the radius with which it is rounded off.
struct RoundedCorner {
  Eigen::Vector2d p_W = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
};

/// A place on a line: where it is, and where the line goes there.
struct LinePlace {
  Eigen::Vector2d p_W = Eigen::Vector2d::Zero();
  Eigen::Vector2d forward = Eigen::Vector2d::UnitX();

  [[nodiscard]] Eigen::Vector2d left() const { return {-forward.y(), forward.x()}; }
};

double LineLength(std::span<const Eigen::Vector2d> line);

/// The line through corners that are rounded off, with points 0.5 m apart.
PlaneLine RoundedLine(std::span<const RoundedCorner> corners);

/// The same line with points as close to `spacing_m` apart as its length allows.
PlaneLine Resampled(const PlaneLine& line, double spacing_m, bool is_closed);

/// The parallel at `left_m` to the left (negative: to the right).
PlaneLine OffsetLine(const PlaneLine& line, double left_m);

PlaneLine ReversedLine(PlaneLine line);

/// The part between two distances from the start, m.
PlaneLine PartOfLine(const PlaneLine& line, double from_m, double to_m);

/// Where the line is at a distance from its start, which is limited to its length.
LinePlace PlaceOnLine(const PlaneLine& line, double distance_m);

/// The distance from the start of the line of its point next to `p_W`, m.
double NearestDistanceAlong(const PlaneLine& line, const Eigen::Vector2d& p_W);

/// How far `p_W` is from the line, m.
double DistanceToLine(std::span<const Eigen::Vector2d> line, const Eigen::Vector2d& p_W);

/// The first line up to where they cross, and the second from there on, with an arc between. Both
/// must be straight near their crossing.
///
/// @return nothing when they do not cross.
std::optional<PlaneLine> JoinedLines(const PlaneLine& first,
                                     const PlaneLine& second,
                                     double radius_m);

/// Takes jumps of the curvature out: `passes` of a binomial filter over points 0.5 m apart.
PlaneLine SmoothedLine(PlaneLine line, int passes, bool is_closed);

}  // namespace relocd
