#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "simulation/torcs_layout.h"
#include "simulation/world.h"

namespace relocd {

/// The surface of a track's mesh, near its road. Where several lie over each other, as at a
/// bridge or under a banner, it is the one that the road as described runs on.
///
/// Heights are averaged over half a metre, so that slopes change gradually from one triangle to
/// the next. Immutable, hence thread-safe.
class TorcsGround final : public Ground {
 public:
  using Triangle = std::array<Eigen::Vector3f, 3>;

  /// @param stations_W  of a closed road, with their coordinates in W, at most 1 m apart.
  /// @param triangles_W  to drive on, among others; steep ones are left out.
  /// @return kInvalidInput when they overlap so much that they do not fit into memory.
  static Result<std::shared_ptr<const TorcsGround>> Create(std::vector<TorcsStation> stations_W,
                                                           double width_m,
                                                           std::span<const Triangle> triangles_W);

  [[nodiscard]] double HeightAt(const Eigen::Vector2d& p_W) const override;
  [[nodiscard]] double HeightAlong(const Eigen::Vector2d& p_W, double heading_rad) const override;

  /// Where the road as described has its surface, near `p_W`: the plane of the nearest station.
  [[nodiscard]] double DescribedHeightAt(const Eigen::Vector2d& p_W) const;

  /// Whether the point is on the road, within half a metre up or down and `margin_m` to the sides.
  [[nodiscard]] bool IsOnRoad(const Eigen::Vector3d& p_W, double margin_m) const;

 private:
  /// Items by the square of the plane that they touch.
  struct Grid {
    Eigen::Vector2d origin = Eigen::Vector2d::Zero();
    double cell_m = 1.0;
    Eigen::Vector2i size = Eigen::Vector2i::Zero();
    std::vector<std::uint32_t> starts;  ///< Of each cell's items, and the end.
    std::vector<std::uint32_t> items;

    [[nodiscard]] Eigen::Vector2i CellOf(const Eigen::Vector2d& p) const;
    [[nodiscard]] std::span<const std::uint32_t> ItemsOf(const Eigen::Vector2i& cell) const;
    /// Takes (cell, item) pairs.
    void Fill(std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs);
  };

  TorcsGround(std::vector<TorcsStation> stations_W, double width_m);

  [[nodiscard]] static Grid MakeGrid(const std::vector<TorcsStation>& stations, double cell_m);
  [[nodiscard]] Result<void> AddTriangles(std::span<const Triangle> triangles_W);
  /// At least those within the radius.
  [[nodiscard]] std::vector<std::uint32_t> StationsNear(const Eigen::Vector2d& p,
                                                        double radius_m) const;
  [[nodiscard]] std::size_t NearestStation(const Eigen::Vector2d& p) const;
  /// Of those nearby, the nearest for which `difference` is hardly more than the least.
  template <typename Difference>
  [[nodiscard]] std::size_t NearestFitting(const Eigen::Vector2d& p,
                                           const Difference& difference,
                                           double hardly) const;
  [[nodiscard]] double PlaneOf(std::size_t station, const Eigen::Vector2d& p) const;
  /// The height nearest to `z` of a triangle at `p`; NaN where there is none.
  [[nodiscard]] double MeshHeight(const Eigen::Vector2d& p, double z) const;
  [[nodiscard]] double SmoothHeight(const Eigen::Vector2d& p, double z) const;

  std::vector<TorcsStation> stations_;
  double width_;
  std::vector<Triangle> triangles_;
  Grid triangle_grid_;
  Grid station_grid_;
};

}  // namespace relocd
