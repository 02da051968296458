#include "simulation/torcs_placement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

constexpr double kToleranceM = 0.3;
constexpr double kCellM = 1.0;  ///< At least twice the tolerance, so that four cells are enough.
constexpr double kSmallestPart = 0.9;
constexpr std::size_t kScoredPoints = 300;
constexpr std::size_t kGlimpse = 12;  ///< Points that tell most wrong places.

/// Vertices by the cell of the plane that they are in.
class VertexGrid {
 public:
  explicit VertexGrid(std::span<const Eigen::Vector3f> vertices) {
    entries_.reserve(vertices.size());
    for (const Eigen::Vector3f& vertex : vertices) {
      entries_.push_back({KeyOf(CellOf(vertex.x()), CellOf(vertex.y())), vertex});
    }
    std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
      return a.key < b.key;
    });
  }

  [[nodiscard]] bool HasNear(const Eigen::Vector3d& p, double tolerance) const {
    for (const std::int64_t x : {CellOf(p.x() - tolerance), CellOf(p.x() + tolerance)}) {
      for (const std::int64_t y : {CellOf(p.y() - tolerance), CellOf(p.y() + tolerance)}) {
        if (CellHasNear(KeyOf(x, y), p, tolerance)) return true;
      }
    }
    return false;
  }

 private:
  struct Entry {
    std::uint64_t key = 0;
    Eigen::Vector3f position;
  };

  static std::int64_t CellOf(double coordinate) {
    return static_cast<std::int64_t>(std::floor(coordinate / kCellM));
  }
  static std::uint64_t KeyOf(std::int64_t x, std::int64_t y) {
    return static_cast<std::uint64_t>(x) << 32U ^ (static_cast<std::uint64_t>(y) & 0xffffffffU);
  }

  [[nodiscard]] bool CellHasNear(std::uint64_t key,
                                 const Eigen::Vector3d& p,
                                 double tolerance) const {
    auto entry = std::lower_bound(
        entries_.begin(), entries_.end(), key, [](const Entry& a, std::uint64_t wanted) {
          return a.key < wanted;
        });
    for (; entry != entries_.end() && entry->key == key; ++entry) {
      if ((entry->position.cast<double>() - p).squaredNorm() <= tolerance * tolerance) return true;
    }
    return false;
  }

  std::vector<Entry> entries_;
};

/// Both ends of a cross-section.
std::array<Eigen::Vector3d, 2> EdgesOf(const TorcsStation& station, double width) {
  const Eigen::Vector2d left(-std::sin(station.yaw_T_rad), std::cos(station.yaw_T_rad));
  const Eigen::Vector2d left_edge = station.p_T + 0.5 * width * left;
  const Eigen::Vector2d right_edge = station.p_T - 0.5 * width * left;
  return {Eigen::Vector3d(left_edge.x(), left_edge.y(), station.left_z_T),
          Eigen::Vector3d(right_edge.x(), right_edge.y(), station.right_z_T)};
}

/// The edges of evenly many of the stations, in an order such that the first few are far apart.
std::vector<Eigen::Vector3d> PointsToScore(const TorcsLayout& layout) {
  std::vector<Eigen::Vector3d> points;
  for (const TorcsStation& station : layout.stations) {
    if (!station.is_mesh_boundary) continue;
    const auto edges = EdgesOf(station, layout.width_m);
    points.insert(points.end(), edges.begin(), edges.end());
  }
  const std::size_t count = std::min(points.size(), kScoredPoints);
  // A stride without a common divisor with the count visits all.
  constexpr std::size_t kStride = 7919;
  std::vector<Eigen::Vector3d> chosen;
  for (std::size_t i = 0; i < count; ++i) {
    chosen.push_back(points[i * kStride % count * points.size() / count]);
  }
  return chosen;
}

double PartThatMeets(const VertexGrid& grid,
                     std::span<const Eigen::Vector3d> points_T,
                     const Eigen::Vector3d& p_WT) {
  const auto met = std::count_if(points_T.begin(), points_T.end(), [&](const auto& p_TQ) {
    return grid.HasNear(p_WT + p_TQ, kToleranceM);
  });
  return static_cast<double>(met) / static_cast<double>(points_T.size());
}

}  // namespace

Result<Eigen::Vector3d> FindTrackInMesh(const TorcsLayout& layout,
                                        std::span<const Eigen::Vector3f> vertices_W) {
  const VertexGrid grid(vertices_W);
  const std::vector<Eigen::Vector3d> points_T = PointsToScore(layout);
  const std::span glimpse = std::span(points_T).first(std::min(kGlimpse, points_T.size()));
  const auto first_edges = EdgesOf(layout.stations.front(), layout.width_m);
  double best_part = 0.0;
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& vertex : vertices_W) {
    // Suppose that this vertex is the beginning's right edge.
    const Eigen::Vector3d p_WT = vertex.cast<double>() - first_edges[1];
    if (!grid.HasNear(p_WT + first_edges[0], 0.1)) continue;
    if (PartThatMeets(grid, glimpse, p_WT) < 0.5) continue;
    const double part = PartThatMeets(grid, points_T, p_WT);
    if (part > best_part) {
      best_part = part;
      best = p_WT;
    }
    if (part == 1.0) break;
  }
  if (best_part >= kSmallestPart) return best;
  return Error{ErrorKind::kInvalidInput,
               fmt::format("the road as described fits the mesh nowhere: at best {:.0f} % of its "
                           "edge points are vertices, must be {:.0f} %",
                           100.0 * best_part,
                           100.0 * kSmallestPart)};
}

}  // namespace relocd
