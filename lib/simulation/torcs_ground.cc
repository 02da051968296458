#include "simulation/torcs_ground.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

namespace relocd {
namespace {

constexpr double kMarginM = 80.0;  ///< Round the road, within which there are triangles.
constexpr double kTriangleCellM = 4.0;
constexpr double kStationCellM = 20.0;
constexpr double kMaxCellsASide = 2000.0;
constexpr std::size_t kMaxPairs = 30'000'000;
constexpr float kSmallestUp = 0.5F;  ///< Of a normal's z: slopes up to 60 degrees.
constexpr double kSmoothingM = 0.5;
constexpr double kLargestStepM = 0.3;

using Triangle = TorcsGround::Triangle;

/// The height at `p` of the triangle's plane, or NaN where `p` is beside it.
double HeightOf(const Triangle& triangle, const Eigen::Vector2d& p) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  constexpr double kSlack = 1e-6;
  const Eigen::Vector2d a = triangle[0].head<2>().cast<double>();
  const Eigen::Vector2d u = triangle[1].head<2>().cast<double>() - a;
  const Eigen::Vector2d v = triangle[2].head<2>().cast<double>() - a;
  const Eigen::Vector2d q = p - a;
  const double area = u.x() * v.y() - u.y() * v.x();
  if (area == 0.0) return kNone;
  const double b = (q.x() * v.y() - q.y() * v.x()) / area;
  const double c = (u.x() * q.y() - u.y() * q.x()) / area;
  if (b < -kSlack || c < -kSlack || b + c > 1.0 + kSlack) return kNone;
  return (1.0 - b - c) * static_cast<double>(triangle[0].z()) +
         b * static_cast<double>(triangle[1].z()) + c * static_cast<double>(triangle[2].z());
}

/// Pairs an item with all cells of a rectangle.
void AppendCells(const Eigen::Vector2i& first,
                 const Eigen::Vector2i& last,
                 int columns,
                 std::uint32_t item,
                 std::vector<std::pair<std::uint32_t, std::uint32_t>>& pairs) {
  for (int y = first.y(); y <= last.y(); ++y) {
    for (int x = first.x(); x <= last.x(); ++x) {
      pairs.emplace_back(static_cast<std::uint32_t>(y * columns + x), item);
    }
  }
}

bool IsDrivable(const Triangle& triangle) {
  const Eigen::Vector3f normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
  return std::abs(normal.z()) > kSmallestUp * normal.norm();
}

}  // namespace

Eigen::Vector2i TorcsGround::Grid::CellOf(const Eigen::Vector2d& p) const {
  const Eigen::Array2d cell = ((p - origin) / cell_m).array().floor();
  return cell.max(0.0).min(size.array().cast<double>() - 1.0).cast<int>();
}

std::span<const std::uint32_t> TorcsGround::Grid::ItemsOf(const Eigen::Vector2i& cell) const {
  const auto index = static_cast<std::size_t>(cell.y() * size.x() + cell.x());
  return std::span(items).subspan(starts[index], starts[index + 1] - starts[index]);
}

void TorcsGround::Grid::Fill(std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs) {
  std::sort(pairs.begin(), pairs.end());
  starts.assign(static_cast<std::size_t>(size.x() * size.y()) + 1, 0);
  for (const auto& [cell, item] : pairs) {
    ++starts[cell + 1];
    items.push_back(item);
  }
  for (std::size_t i = 1; i < starts.size(); ++i) {
    starts[i] += starts[i - 1];
  }
}

TorcsGround::Grid TorcsGround::MakeGrid(const std::vector<TorcsStation>& stations, double cell_m) {
  Eigen::Vector2d low = stations.front().p_T;
  Eigen::Vector2d high = low;
  for (const TorcsStation& station : stations) {
    low = low.cwiseMin(station.p_T);
    high = high.cwiseMax(station.p_T);
  }
  Grid grid;
  grid.origin = low - Eigen::Vector2d::Constant(kMarginM);
  const Eigen::Vector2d extent = high - low + Eigen::Vector2d::Constant(2.0 * kMarginM);
  grid.cell_m = std::max(cell_m, extent.maxCoeff() / kMaxCellsASide);
  grid.size = (extent / grid.cell_m).array().floor().cast<int>() + 1;
  return grid;
}

TorcsGround::TorcsGround(std::vector<TorcsStation> stations_W, double width_m)
    : stations_(std::move(stations_W)), width_(width_m) {
  station_grid_ = MakeGrid(stations_, kStationCellM);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  for (std::size_t i = 0; i < stations_.size(); ++i) {
    const Eigen::Vector2i cell = station_grid_.CellOf(stations_[i].p_T);
    pairs.emplace_back(static_cast<std::uint32_t>(cell.y() * station_grid_.size.x() + cell.x()),
                       static_cast<std::uint32_t>(i));
  }
  station_grid_.Fill(std::move(pairs));
}

Result<std::shared_ptr<const TorcsGround>> TorcsGround::Create(
    std::vector<TorcsStation> stations_W, double width_m, std::span<const Triangle> triangles_W) {
  const std::shared_ptr<TorcsGround> ground(new TorcsGround(std::move(stations_W), width_m));
  if (auto ok = ground->AddTriangles(triangles_W); !ok) return ok.error();
  return std::shared_ptr<const TorcsGround>(ground);
}

Result<void> TorcsGround::AddTriangles(std::span<const Triangle> triangles_W) {
  Grid& grid = triangle_grid_;
  grid = MakeGrid(stations_, kTriangleCellM);
  const Eigen::Vector2d end = grid.origin + grid.cell_m * grid.size.cast<double>();
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  for (const Triangle& triangle : triangles_W) {
    if (!IsDrivable(triangle)) continue;
    const Eigen::Vector3f low = triangle[0].cwiseMin(triangle[1]).cwiseMin(triangle[2]);
    const Eigen::Vector3f high = triangle[0].cwiseMax(triangle[1]).cwiseMax(triangle[2]);
    const Eigen::Vector2d low_W = low.head<2>().cast<double>();
    const Eigen::Vector2d high_W = high.head<2>().cast<double>();
    if ((high_W.array() < grid.origin.array()).any() || (low_W.array() > end.array()).any())
      continue;
    const Eigen::Vector2i first = grid.CellOf(low_W);
    const Eigen::Vector2i last = grid.CellOf(high_W);
    const Eigen::Vector2i cells = last - first + Eigen::Vector2i::Ones();
    if (pairs.size() + static_cast<std::size_t>(cells.prod()) > kMaxPairs)
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("too many large triangles: they cover more than {} squares of {} m",
                               kMaxPairs,
                               grid.cell_m)};
    AppendCells(first, last, grid.size.x(), static_cast<std::uint32_t>(triangles_.size()), pairs);
    triangles_.push_back(triangle);
  }
  grid.Fill(std::move(pairs));
  return {};
}

std::vector<std::uint32_t> TorcsGround::StationsNear(const Eigen::Vector2d& p,
                                                     double radius_m) const {
  std::vector<std::uint32_t> near;
  const Eigen::Vector2i first = station_grid_.CellOf(p - Eigen::Vector2d::Constant(radius_m));
  const Eigen::Vector2i last = station_grid_.CellOf(p + Eigen::Vector2d::Constant(radius_m));
  for (int y = first.y(); y <= last.y(); ++y) {
    for (int x = first.x(); x <= last.x(); ++x) {
      const auto stations = station_grid_.ItemsOf({x, y});
      near.insert(near.end(), stations.begin(), stations.end());
    }
  }
  return near;
}

std::size_t TorcsGround::NearestStation(const Eigen::Vector2d& p) const {
  const auto distance_to = [&](std::size_t i) { return (stations_[i].p_T - p).norm(); };
  for (double radius = 0.5 * width_;; radius *= 2.0) {
    const auto near = StationsNear(p, radius);
    const auto nearest = std::min_element(
        near.begin(), near.end(), [&](auto a, auto b) { return distance_to(a) < distance_to(b); });
    // What is further away than the radius may be missing.
    const bool has_all = near.size() == stations_.size();
    if (nearest != near.end() && (has_all || distance_to(*nearest) <= radius)) return *nearest;
  }
}

template <typename Difference>
std::size_t TorcsGround::NearestFitting(const Eigen::Vector2d& p,
                                        const Difference& difference,
                                        double hardly) const {
  std::size_t best = NearestStation(p);
  double least = difference(best);
  if (least <= hardly) return best;
  const double radius = 0.5 * width_ + 3.0;
  const auto near = StationsNear(p, radius);
  const auto distance_to = [&](std::size_t i) { return (stations_[i].p_T - p).norm(); };
  for (const std::uint32_t i : near) {
    if (distance_to(i) <= radius) least = std::min(least, difference(i));
  }
  double best_distance = std::numeric_limits<double>::infinity();
  for (const std::uint32_t i : near) {
    const double distance = distance_to(i);
    if (distance > radius || distance >= best_distance) continue;
    if (difference(i) > least + hardly) continue;
    best = i;
    best_distance = distance;
  }
  return best;
}

double TorcsGround::PlaneOf(std::size_t station, const Eigen::Vector2d& p) const {
  const TorcsStation& here = stations_[station];
  const TorcsStation& next = stations_[(station + 1) % stations_.size()];
  const Eigen::Vector2d ahead(std::cos(here.yaw_T_rad), std::sin(here.yaw_T_rad));
  const Eigen::Vector2d offset = p - here.p_T;
  const double along = std::clamp(ahead.dot(offset), -1.0, 1.0);
  const double to_left = ahead.x() * offset.y() - ahead.y() * offset.x();
  const double across = std::clamp(to_left, -width_, width_);
  const double z = 0.5 * (here.left_z_T + here.right_z_T);
  const double next_z = 0.5 * (next.left_z_T + next.right_z_T);
  const double distance = (next.p_T - here.p_T).norm();
  const double slope = distance > 0.1 ? std::clamp((next_z - z) / distance, -1.0, 1.0) : 0.0;
  return z + across / width_ * (here.left_z_T - here.right_z_T) + along * slope;
}

double TorcsGround::MeshHeight(const Eigen::Vector2d& p, double z) const {
  double best = std::numeric_limits<double>::quiet_NaN();
  for (const std::uint32_t i : triangle_grid_.ItemsOf(triangle_grid_.CellOf(p))) {
    const double height = HeightOf(triangles_[i], p);
    if (std::isfinite(height) && !(std::abs(best - z) <= std::abs(height - z))) best = height;
  }
  return best;
}

/// A tent of nine points, of which those beyond a step, as on a wall, do not count.
double TorcsGround::SmoothHeight(const Eigen::Vector2d& p, double z) const {
  const double middle = MeshHeight(p, z);
  if (!std::isfinite(middle)) return z;
  double sum = 0.0;
  double weights = 0.0;
  for (int y = -1; y <= 1; ++y) {
    for (int x = -1; x <= 1; ++x) {
      const double height = MeshHeight(p + kSmoothingM * Eigen::Vector2d(x, y), middle);
      if (!(std::abs(height - middle) <= kLargestStepM)) continue;
      const double weight = (2 - std::abs(x)) * (2 - std::abs(y));
      sum += weight * height;
      weights += weight;
    }
  }
  return sum / weights;
}

double TorcsGround::HeightAt(const Eigen::Vector2d& p_W) const {
  return SmoothHeight(p_W, DescribedHeightAt(p_W));
}

double TorcsGround::HeightAlong(const Eigen::Vector2d& p_W, double heading_rad) const {
  // Of two lines, from 0 for parallel ones to 1 for a right angle.
  const auto angle_to = [&](std::size_t station) {
    return std::abs(std::sin(stations_[station].yaw_T_rad - heading_rad));
  };
  constexpr double kSamePart = 0.4;
  return SmoothHeight(p_W, PlaneOf(NearestFitting(p_W, angle_to, kSamePart), p_W));
}

double TorcsGround::DescribedHeightAt(const Eigen::Vector2d& p_W) const {
  return PlaneOf(NearestStation(p_W), p_W);
}

bool TorcsGround::IsOnRoad(const Eigen::Vector3d& p_W, double margin_m) const {
  constexpr double kHeightM = 0.5;
  const auto step_to = [&](std::size_t station) {
    return std::abs(PlaneOf(station, p_W.head<2>()) - p_W.z());
  };
  const std::size_t station = NearestFitting(p_W.head<2>(), step_to, kHeightM);
  // Stations are at most 1 m apart along the road.
  return (stations_[station].p_T - p_W.head<2>()).norm() <= 0.5 * width_ + margin_m + 0.5 &&
         step_to(station) <= kHeightM;
}

}  // namespace relocd
