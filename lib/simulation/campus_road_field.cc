#include "simulation/campus_road_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>

namespace relocd {
namespace {

/// The union of two shapes by their distances, its concave corners rounded with `radius`.
double RoundedUnion(double a, double b, double radius) {
  const double within_a = std::max(radius - a, 0.0);
  const double within_b = std::max(radius - b, 0.0);
  return std::max(radius, std::min(a, b)) - std::hypot(within_a, within_b);
}

double DistanceToSegment(const Eigen::Vector2d& p,
                         const Eigen::Vector2d& start,
                         const Eigen::Vector2d& end) {
  const Eigen::Vector2d step = end - start;
  const double part =
      std::clamp((p - start).dot(step) / std::max(step.squaredNorm(), 1e-12), 0.0, 1.0);
  return (start + part * step - p).norm();
}

/// An edge of the grid's triangles, by its two nodes in ascending order.
using EdgeKey = std::pair<std::uint32_t, std::uint32_t>;

struct ContourStep {
  EdgeKey to;
  Eigen::Vector2d p_W = Eigen::Vector2d::Zero();  ///< Of the edge that it starts from.
};

struct TriangleNode {
  Eigen::Vector2d p_W;
  double distance = 0.0;
  std::uint32_t index = 0;
};

Eigen::Vector2d CrossingPoint(const TriangleNode& a, const TriangleNode& b) {
  return a.p_W + a.distance / (a.distance - b.distance) * (b.p_W - a.p_W);
}

EdgeKey KeyOf(const TriangleNode& a, const TriangleNode& b) {
  return std::minmax(a.index, b.index);
}

/// Adds the piece of the contour that crosses a counter-clockwise triangle, with its negative side
/// on the left.
void AddTriangle(const std::array<TriangleNode, 3>& nodes, std::map<EdgeKey, ContourStep>& steps) {
  for (std::size_t i = 0; i < 3; ++i) {
    const TriangleNode& a = nodes.at(i);
    const TriangleNode& b = nodes.at((i + 1) % 3);
    const TriangleNode& c = nodes.at((i + 2) % 3);
    const bool a_inside = a.distance < 0.0;
    if (a_inside == (b.distance < 0.0) || a_inside == (c.distance < 0.0)) continue;
    // `a` alone is on its side. Where it is inside, the contour runs from edge ab to edge ca, which
    // has `a` on its left.
    const EdgeKey ab = KeyOf(a, b);
    const EdgeKey ca = KeyOf(c, a);
    if (a_inside) {
      steps[ab] = {ca, CrossingPoint(a, b)};
    } else {
      steps[ca] = {ab, CrossingPoint(c, a)};
    }
  }
}

std::vector<RoadContour> Chained(std::map<EdgeKey, ContourStep> steps) {
  std::vector<RoadContour> contours;
  while (!steps.empty()) {
    RoadContour contour;
    const EdgeKey start = steps.begin()->first;
    EdgeKey edge = start;
    for (auto step = steps.find(edge); step != steps.end(); step = steps.find(edge)) {
      contour.points.push_back(step->second.p_W);
      edge = step->second.to;
      steps.erase(step);
    }
    contour.is_closed = edge == start;
    // Pieces of an open contour would come out of order; the grid is large enough that there are
    // none.
    if (contour.is_closed && contour.points.size() > 8) contours.push_back(std::move(contour));
  }
  return contours;
}

}  // namespace

RoadField::RoadField(const Eigen::Vector2i& low, const Eigen::Vector2i& high)
    : low_(low), high_(high), columns_(high.x() - low.x() + 1) {
  const auto rows = static_cast<std::size_t>(high.y() - low.y() + 1);
  distances_.assign(static_cast<std::size_t>(columns_) * rows, kFarAway);
}

void RoadField::AddStrip(std::span<const Eigen::Vector2d> line,
                         double half_width_m,
                         double corner_radius_m) {
  std::vector<double> strip(distances_.size(), kFarAway);
  const double reach = kFarAway + half_width_m;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Eigen::Vector2d middle = 0.5 * (line[i] + line[i + 1]);
    const double radius = reach + 0.5 * (line[i + 1] - line[i]).norm();
    const int y_first = std::max(low_.y(), static_cast<int>(std::floor(middle.y() - radius)));
    const int y_last = std::min(high_.y(), static_cast<int>(std::ceil(middle.y() + radius)));
    const int x_first = std::max(low_.x(), static_cast<int>(std::floor(middle.x() - radius)));
    const int x_last = std::min(high_.x(), static_cast<int>(std::ceil(middle.x() + radius)));
    for (int y = y_first; y <= y_last; ++y) {
      for (int x = x_first; x <= x_last; ++x) {
        double& distance = strip[NodeIndex(x, y)];
        distance =
            std::min(distance, DistanceToSegment({x, y}, line[i], line[i + 1]) - half_width_m);
      }
    }
  }
  for (std::size_t i = 0; i < distances_.size(); ++i)
    distances_[i] = RoundedUnion(distances_[i], strip[i], corner_radius_m);
}

double RoadField::DistanceAt(const Eigen::Vector2d& p_W) const {
  const int x = static_cast<int>(std::floor(p_W.x()));
  const int y = static_cast<int>(std::floor(p_W.y()));
  if (x < low_.x() || y < low_.y() || x >= high_.x() || y >= high_.y()) return kFarAway;
  const double u = p_W.x() - x;
  const double v = p_W.y() - y;
  const double origin = NodeDistance(x, y);
  const double diagonal = NodeDistance(x + 1, y + 1);
  // The two triangles that the surface is made of, too.
  if (u > v) {
    const double corner = NodeDistance(x + 1, y);
    return origin + u * (corner - origin) + v * (diagonal - corner);
  }
  const double corner = NodeDistance(x, y + 1);
  return origin + v * (corner - origin) + u * (diagonal - corner);
}

Eigen::Vector2d RoadField::AwayFromRoad(const Eigen::Vector2d& p_W) const {
  constexpr double kStep = 0.6;
  const Eigen::Vector2d dx(kStep, 0.0);
  const Eigen::Vector2d dy(0.0, kStep);
  const Eigen::Vector2d gradient(DistanceAt(p_W + dx) - DistanceAt(p_W - dx),
                                 DistanceAt(p_W + dy) - DistanceAt(p_W - dy));
  return gradient.norm() > 1e-9 ? gradient.normalized() : Eigen::Vector2d::UnitX();
}

std::vector<RoadContour> RoadField::Contours(double level_m) const {
  std::map<EdgeKey, ContourStep> steps;
  const auto node = [&](int x, int y) {
    return TriangleNode{
        {x, y}, NodeDistance(x, y) - level_m, static_cast<std::uint32_t>(NodeIndex(x, y))};
  };
  for (int y = low_.y(); y < high_.y(); ++y) {
    for (int x = low_.x(); x < high_.x(); ++x) {
      if (std::abs(NodeDistance(x, y) - level_m) > 3.0) continue;
      AddTriangle({node(x, y), node(x + 1, y), node(x + 1, y + 1)}, steps);
      AddTriangle({node(x, y), node(x + 1, y + 1), node(x, y + 1)}, steps);
    }
  }
  return Chained(std::move(steps));
}

}  // namespace relocd
