#include "simulation/campus_lines.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "core/check.h"

namespace relocd {
namespace {

constexpr double kSpacing = 0.5;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// The arc that leaves `start` towards `forward` and turns by `turn` (left positive).
void AppendArc(const LinePlace& start, double turn, double radius, PlaneLine& line) {
  const int steps = std::max(2, static_cast<int>(std::ceil(std::abs(turn) * radius / kSpacing)));
  const double side = turn > 0.0 ? 1.0 : -1.0;
  const Eigen::Vector2d centre = start.p_W + side * radius * start.left();
  for (int i = 0; i <= steps; ++i) {
    const double angle = turn * i / steps;
    const Eigen::Vector2d arm = -side * radius * start.left();
    line.push_back(centre + Eigen::Vector2d(std::cos(angle) * arm.x() - std::sin(angle) * arm.y(),
                                            std::sin(angle) * arm.x() + std::cos(angle) * arm.y()));
  }
}

double TurnBetween(const Eigen::Vector2d& before, const Eigen::Vector2d& after) {
  return std::atan2(Cross(before, after), before.dot(after));
}

struct LineCrossing {
  double first_distance = 0.0;
  double second_distance = 0.0;
};

std::optional<LineCrossing> FindCrossing(const PlaneLine& first, const PlaneLine& second) {
  double first_distance = 0.0;
  for (std::size_t i = 0; i + 1 < first.size(); ++i) {
    const Eigen::Vector2d a = first[i + 1] - first[i];
    double second_distance = 0.0;
    for (std::size_t j = 0; j + 1 < second.size(); ++j) {
      const Eigen::Vector2d b = second[j + 1] - second[j];
      const double area = Cross(a, b);
      const Eigen::Vector2d gap = second[j] - first[i];
      const double t = Cross(gap, b) / area;
      const double u = Cross(gap, a) / area;
      if (std::abs(area) > 1e-9 && t >= 0.0 && t <= 1.0 && u >= 0.0 && u <= 1.0)
        return LineCrossing{first_distance + t * a.norm(), second_distance + u * b.norm()};
      second_distance += b.norm();
    }
    first_distance += a.norm();
  }
  return std::nullopt;
}

}  // namespace

double LineLength(std::span<const Eigen::Vector2d> line) {
  double length = 0.0;
  for (std::size_t i = 0; i + 1 < line.size(); ++i)
    length += (line[i + 1] - line[i]).norm();
  return length;
}

PlaneLine RoundedLine(std::span<const RoundedCorner> corners) {
  PlaneLine line{corners.front().p_W};
  double used = 0.0;  // Of the way to the next corner, by the arc round the last one.
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
    const Eigen::Vector2d before = (corners[i].p_W - corners[i - 1].p_W).normalized();
    const Eigen::Vector2d after = (corners[i + 1].p_W - corners[i].p_W).normalized();
    const double turn = TurnBetween(before, after);
    const double tangent = corners[i].radius_m * std::tan(std::abs(turn) / 2.0);
    RELOCD_CHECK(used + tangent <= (corners[i].p_W - corners[i - 1].p_W).norm(),
                 "arcs of a line must not overlap");
    used = tangent;
    if (std::abs(turn) < 1e-6) continue;
    AppendArc({corners[i].p_W - tangent * before, before}, turn, corners[i].radius_m, line);
  }
  line.push_back(corners.back().p_W);
  return Resampled(line, kSpacing, false);
}

PlaneLine Resampled(const PlaneLine& line, double spacing_m, bool is_closed) {
  PlaneLine source = line;
  if (is_closed) source.push_back(line.front());
  const double length = LineLength(source);
  const auto steps = static_cast<std::size_t>(std::max(1.0, std::round(length / spacing_m)));
  PlaneLine result;
  result.reserve(steps + 1);
  std::size_t segment = 0;
  double passed = 0.0;
  for (std::size_t i = 0; i < steps + (is_closed ? 0U : 1U); ++i) {
    const double wanted = length * static_cast<double>(i) / static_cast<double>(steps);
    double size = (source[segment + 1] - source[segment]).norm();
    while (segment + 2 < source.size() && passed + size < wanted) {
      passed += size;
      ++segment;
      size = (source[segment + 1] - source[segment]).norm();
    }
    const double part = size > 0.0 ? std::clamp((wanted - passed) / size, 0.0, 1.0) : 0.0;
    result.emplace_back(source[segment] + part * (source[segment + 1] - source[segment]));
  }
  return result;
}

PlaneLine OffsetLine(const PlaneLine& line, double left_m) {
  PlaneLine result;
  result.reserve(line.size());
  for (std::size_t i = 0; i < line.size(); ++i) {
    const Eigen::Vector2d forward =
        (line[std::min(i + 1, line.size() - 1)] - line[i > 0 ? i - 1 : 0]).normalized();
    result.emplace_back(line[i] + left_m * Eigen::Vector2d(-forward.y(), forward.x()));
  }
  return result;
}

PlaneLine ReversedLine(PlaneLine line) {
  std::reverse(line.begin(), line.end());
  return line;
}

PlaneLine PartOfLine(const PlaneLine& line, double from_m, double to_m) {
  PlaneLine part{PlaceOnLine(line, from_m).p_W};
  double passed = 0.0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (i > 0) passed += (line[i] - line[i - 1]).norm();
    if (passed > from_m + 1e-6 && passed < to_m - 1e-6) part.push_back(line[i]);
  }
  part.push_back(PlaceOnLine(line, to_m).p_W);
  return part;
}

LinePlace PlaceOnLine(const PlaneLine& line, double distance_m) {
  double left = std::max(distance_m, 0.0);
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Eigen::Vector2d step = line[i + 1] - line[i];
    const double size = step.norm();
    if (size > 0.0 && (left <= size || i + 2 == line.size()))
      return {line[i] + std::min(left / size, 1.0) * step, step / size};
    left -= size;
  }
  return {line.back(), Eigen::Vector2d::UnitX()};
}

double NearestDistanceAlong(const PlaneLine& line, const Eigen::Vector2d& p_W) {
  double best = std::numeric_limits<double>::infinity();
  double best_distance = 0.0;
  double passed = 0.0;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Eigen::Vector2d step = line[i + 1] - line[i];
    const double part = std::clamp((p_W - line[i]).dot(step) / step.squaredNorm(), 0.0, 1.0);
    const double gap = (line[i] + part * step - p_W).norm();
    if (gap < best) {
      best = gap;
      best_distance = passed + part * step.norm();
    }
    passed += step.norm();
  }
  return best_distance;
}

double DistanceToLine(std::span<const Eigen::Vector2d> line, const Eigen::Vector2d& p_W) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Eigen::Vector2d step = line[i + 1] - line[i];
    const double part =
        std::clamp((p_W - line[i]).dot(step) / std::max(step.squaredNorm(), 1e-12), 0.0, 1.0);
    best = std::min(best, (line[i] + part * step - p_W).norm());
  }
  return best;
}

std::optional<PlaneLine> JoinedLines(const PlaneLine& first,
                                     const PlaneLine& second,
                                     double radius_m) {
  const auto crossing = FindCrossing(first, second);
  if (!crossing) return std::nullopt;
  const LinePlace before = PlaceOnLine(first, crossing->first_distance - 1.0);
  const LinePlace after = PlaceOnLine(second, crossing->second_distance + 1.0);
  const double turn = TurnBetween(before.forward, after.forward);
  const double tangent = radius_m * std::tan(std::abs(turn) / 2.0);
  PlaneLine joined = PartOfLine(first, 0.0, crossing->first_distance - tangent);
  AppendArc(PlaceOnLine(first, crossing->first_distance - tangent), turn, radius_m, joined);
  const PlaneLine rest =
      PartOfLine(second, crossing->second_distance + tangent, LineLength(second));
  joined.insert(joined.end(), rest.begin(), rest.end());
  return Resampled(joined, kSpacing, false);
}

PlaneLine SmoothedLine(PlaneLine line, int passes, bool is_closed) {
  const std::size_t count = line.size();
  for (int pass = 0; pass < passes; ++pass) {
    PlaneLine smooth = line;
    for (std::size_t i = 0; i < count; ++i) {
      if (!is_closed && (i == 0 || i + 1 == count)) continue;
      smooth[i] =
          0.25 * line[(i + count - 1) % count] + 0.5 * line[i] + 0.25 * line[(i + 1) % count];
    }
    line = std::move(smooth);
  }
  return line;
}

}  // namespace relocd
