#include "simulation/campus_surfaces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "rendering/mesh_builder.h"
#include "simulation/campus_textures.h"

namespace relocd {
namespace {

constexpr int kBlock = 4;           // Side of the squares that lawns far from roads consist of, m.
constexpr double kFineReach = 6.0;  // From the road up to which the ground has its full detail.
constexpr float kKerbTop = 0.15F;   // How wide kerb stones are, m.
constexpr double kGutterWidth = 0.3;
constexpr double kGutterHeight = 0.004;

/// Triangles that share their vertices where they meet, with smooth normals of the terrain.
class SurfaceMesh {
 public:
  SurfaceMesh(const CampusTerrain& terrain, double above, std::uint32_t material, float tile)
      : terrain_(terrain), above_(above), material_(material), tile_(tile) {}

  /// A convex polygon, counter-clockwise.
  void AddPolygon(std::span<const Eigen::Vector2d> polygon) {
    for (std::size_t i = 2; i < polygon.size(); ++i) {
      mesh_.triangles.push_back({Vertex(polygon[0]), Vertex(polygon[i - 1]), Vertex(polygon[i])});
      mesh_.triangle_materials.push_back(material_);
    }
  }

  Mesh Take() { return std::move(mesh_); }
  [[nodiscard]] bool empty() const { return mesh_.triangles.empty(); }

 private:
  std::uint32_t Vertex(const Eigen::Vector2d& p_W) {
    const auto key = std::pair{std::llround(p_W.x() * 2000.0), std::llround(p_W.y() * 2000.0)};
    const auto [found, is_new] =
        vertices_.try_emplace(key, static_cast<std::uint32_t>(mesh_.positions.size()));
    if (is_new) {
      const double z = terrain_.HeightAt(p_W);
      const double dx = terrain_.HeightAt(p_W + Eigen::Vector2d(0.5, 0.0)) - z;
      const double dy = terrain_.HeightAt(p_W + Eigen::Vector2d(0.0, 0.5)) - z;
      mesh_.positions.emplace_back(Eigen::Vector3d(p_W.x(), p_W.y(), z + above_).cast<float>());
      mesh_.normals.emplace_back(
          Eigen::Vector3d(-2.0 * dx, -2.0 * dy, 1.0).normalized().cast<float>());
      mesh_.uvs.emplace_back((p_W / tile_).cast<float>());
    }
    return found->second;
  }

  const CampusTerrain& terrain_;
  double above_;
  std::uint32_t material_;
  float tile_;
  Mesh mesh_;
  std::map<std::pair<long long, long long>, std::uint32_t> vertices_;
};

struct FieldPoint {
  Eigen::Vector2d p_W = Eigen::Vector2d::Zero();
  double distance = 0.0;
};

using FieldPolygon = std::vector<FieldPoint>;

/// What of a polygon is at `distance >= limit`, or with `keep_below` at most that.
FieldPolygon Clipped(const FieldPolygon& polygon, double limit, bool keep_below) {
  const double sign = keep_below ? -1.0 : 1.0;
  FieldPolygon kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const FieldPoint& a = polygon[i];
    const FieldPoint& b = polygon[(i + 1) % polygon.size()];
    const double a_inside = sign * (a.distance - limit);
    const double b_inside = sign * (b.distance - limit);
    if (a_inside >= 0.0) kept.push_back(a);
    if ((a_inside > 0.0 && b_inside < 0.0) || (a_inside < 0.0 && b_inside > 0.0)) {
      // From the same end whichever triangle asks, so that neighbours get the same point.
      const bool a_first = a_inside < 0.0;
      const FieldPoint& from = a_first ? a : b;
      const FieldPoint& to = a_first ? b : a;
      const double part = (limit - from.distance) / (to.distance - from.distance);
      kept.push_back({from.p_W + part * (to.p_W - from.p_W), limit});
    }
  }
  return kept;
}

/// The surfaces of one kind of ground each.
struct GroundMeshes {
  SurfaceMesh road;
  SurfaceMesh old_road;
  SurfaceMesh paving;
  SurfaceMesh setts;
  SurfaceMesh sidewalk_asphalt;
  SurfaceMesh grass;
  SurfaceMesh meadow;
};

/// Cuts the ground into roads, sidewalks and lawns.
class GroundCutter {
 public:
  GroundCutter(const CampusGround& ground, const CampusMaterials& m, const RoadNetwork& network)
      : field_(ground.roads()),
        network_(network),
        meshes_{SurfaceMesh(ground.terrain(), 0.0, m.asphalt, kTileAsphalt),
                SurfaceMesh(ground.terrain(), 0.0, m.asphalt_old, kTileAsphalt),
                SurfaceMesh(ground.terrain(), kCampusKerbHeight, m.paving, kTilePaving),
                SurfaceMesh(ground.terrain(), kCampusKerbHeight, m.setts, kTileSetts),
                SurfaceMesh(ground.terrain(), kCampusKerbHeight, m.asphalt_new, kTileAsphalt),
                SurfaceMesh(ground.terrain(), kCampusKerbHeight, m.grass, kTileGrass),
                SurfaceMesh(ground.terrain(), kCampusKerbHeight, m.meadow, kTileGrass)} {}

  void Cut() {
    for (int y = field_.low().y(); y + kBlock <= field_.high().y(); y += kBlock) {
      for (int x = field_.low().x(); x + kBlock <= field_.high().x(); x += kBlock) {
        if (IsFine(x, y)) {
          CutBlock(x, y);
        } else {
          AddCoarseBlock(x, y);
        }
      }
    }
  }

  void MoveTo(Scene& scene) {
    for (SurfaceMesh* const mesh : {&meshes_.road,
                                    &meshes_.old_road,
                                    &meshes_.paving,
                                    &meshes_.setts,
                                    &meshes_.sidewalk_asphalt,
                                    &meshes_.grass,
                                    &meshes_.meadow}) {
      if (!mesh->empty()) scene.instances.push_back({.mesh = scene.AddMesh(mesh->Take())});
    }
  }

 private:
  [[nodiscard]] bool IsFine(int x, int y) const {
    if (x < field_.low().x() || y < field_.low().y() || x + kBlock > field_.high().x() ||
        y + kBlock > field_.high().y())
      return false;
    for (const int dy : {0, kBlock}) {
      for (const int dx : {0, kBlock}) {
        if (field_.NodeDistance(x + dx, y + dy) < kFineReach) return true;
      }
    }
    return false;
  }

  void CutBlock(int x_first, int y_first) {
    const auto node = [&](int x, int y) { return FieldPoint{{x, y}, field_.NodeDistance(x, y)}; };
    for (int y = y_first; y < y_first + kBlock; ++y) {
      for (int x = x_first; x < x_first + kBlock; ++x) {
        CutTriangle({node(x, y), node(x + 1, y), node(x + 1, y + 1)});
        CutTriangle({node(x, y), node(x + 1, y + 1), node(x, y + 1)});
      }
    }
  }

  void CutTriangle(const FieldPolygon& triangle) {
    const Eigen::Vector2d p_W = (triangle[0].p_W + triangle[1].p_W + triangle[2].p_W) / 3.0;
    AddTo(RoadAt(p_W), Clipped(triangle, 0.0, true));
    const FieldPolygon beside = Clipped(triangle, 0.0, false);
    AddTo(SidewalkAt(p_W), Clipped(beside, kSidewalkWidth, true));
    AddTo(LawnAt(p_W), Clipped(beside, kSidewalkWidth, false));
  }

  static void AddTo(SurfaceMesh& mesh, const FieldPolygon& polygon) {
    std::vector<Eigen::Vector2d> points;
    for (const FieldPoint& point : polygon)
      points.push_back(point.p_W);
    mesh.AddPolygon(points);
  }

  /// A square in four triangles, whose edges are cut as their neighbours' are.
  void AddCoarseBlock(int x, int y) {
    const Eigen::Vector2d centre(x + 0.5 * kBlock, y + 0.5 * kBlock);
    const std::array<Eigen::Vector2d, 4> corners{
        {{x, y}, {x + kBlock, y}, {x + kBlock, y + kBlock}, {x, y + kBlock}}};
    const std::array<Eigen::Vector2i, 4> neighbours{
        {{x, y - kBlock}, {x + kBlock, y}, {x, y + kBlock}, {x - kBlock, y}}};
    SurfaceMesh& mesh = LawnAt(centre);
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d from = corners.at(i);
      const Eigen::Vector2d step = corners.at((i + 1) % 4) - from;
      const int parts = IsFine(neighbours.at(i).x(), neighbours.at(i).y()) ? kBlock : 1;
      for (int part = 0; part < parts; ++part) {
        mesh.AddPolygon(std::array<Eigen::Vector2d, 3>{
            centre, from + step * part / parts, from + step * (part + 1) / parts});
      }
    }
  }

  SurfaceMesh& RoadAt(const Eigen::Vector2d& p_W) {
    const bool is_lot =
        p_W.x() > network_.lot_low.x() - 2.0 && p_W.x() < network_.lot_high.x() + 2.0 &&
        p_W.y() > network_.lot_low.y() - 2.0 && p_W.y() < network_.lot_high.y() + 4.0;
    const bool is_spur = p_W.y() < -12.0 && std::abs(p_W.x() - network_.spur.back().x()) < 22.0;
    return is_lot || is_spur ? meshes_.old_road : meshes_.road;
  }

  SurfaceMesh& SidewalkAt(const Eigen::Vector2d& p_W) {
    const double east = network_.ring.front().x();
    if (p_W.y() < -12.0 && p_W.x() > 20.0) return meshes_.sidewalk_asphalt;
    if (p_W.x() > east - 12.0 && p_W.y() > 12.0) return meshes_.setts;
    return meshes_.paving;
  }

  /// Streets in the south-west are paved up to the shops.
  SurfaceMesh& LawnAt(const Eigen::Vector2d& p_W) {
    if (network_.IsPavedAt(p_W)) return meshes_.paving;
    const bool is_wild = p_W.y() > network_.ring.back().y() + 12.0 || field_.DistanceAt(p_W) > 22.0;
    return is_wild ? meshes_.meadow : meshes_.grass;
  }

  const RoadField& field_;
  const RoadNetwork& network_;
  GroundMeshes meshes_;
};

/// Kerb stones and the gutter before them along one contour; the road is on its left.
void AddKerb(const CampusGround& ground,
             const CampusMaterials& materials,
             const RoadContour& contour,
             MeshBuilder& builder) {
  const std::size_t count = contour.points.size();
  std::vector<Eigen::Vector2d> right(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector2d step =
        (contour.points[(i + 1) % count] - contour.points[(i + count - 1) % count]).normalized();
    right[i] = {step.y(), -step.x()};
  }
  const auto point = [&](std::size_t i, double to_right, double above) -> Eigen::Vector3f {
    const Eigen::Vector2d& p = contour.points[i % count];
    const Eigen::Vector2d q = p + to_right * right[i % count];
    return Eigen::Vector3d(q.x(), q.y(), ground.terrain().HeightAt(q) + above).cast<float>();
  };
  float along = 0.0F;
  for (std::size_t i = 0; i < count; ++i) {
    const auto next =
        static_cast<float>((contour.points[(i + 1) % count] - contour.points[i]).norm());
    const auto strip = [&](const std::array<double, 4>& across,
                           std::uint32_t material,
                           float tile) {
      const Eigen::Vector3f a = point(i, across[0], across[1]);
      const Eigen::Vector3f b = point(i, across[2], across[3]);
      const Eigen::Vector3f c = point(i + 1, across[2], across[3]);
      const Eigen::Vector3f d = point(i + 1, across[0], across[1]);
      const float height = (b - a).norm() / tile;
      const Eigen::Vector2f u(along / tile, (along + next) / tile);
      // Seen from the road, which is on the left of the contour, its direction is to the left.
      builder.AddTriangle({a, b, c}, {{{u[0], 0.0F}, {u[0], height}, {u[1], height}}}, material);
      builder.AddTriangle({a, c, d}, {{{u[0], 0.0F}, {u[1], height}, {u[1], 0.0F}}}, material);
    };
    const double top = kCampusKerbHeight + 0.005;
    strip({kKerbTop, kCampusKerbHeight - 0.01, kKerbTop, top}, materials.kerb, 1.8F);
    strip({kKerbTop, top, 0.015, top}, materials.kerb, 1.8F);
    strip({0.015, top, 0.0, top - 0.02}, materials.kerb, 1.8F);
    strip({0.0, top - 0.02, 0.0, -0.03}, materials.kerb, 1.8F);
    strip({0.0, kGutterHeight, -kGutterWidth, kGutterHeight}, materials.gutter, kTileSetts);
    along += next;
  }
}

/// Rolling country round the town, up to hills at the horizon.
void AddCountry(const CampusGround& ground,
                const CampusMaterials& materials,
                MeshBuilder& builder) {
  const RoadField& field = ground.roads();
  const Eigen::Vector2d low = field.low().cast<double>();
  // Blocks cover whole multiples of their size.
  const Eigen::Vector2d size = (((field.high() - field.low()) / kBlock) * kBlock).cast<double>();
  const Eigen::Vector2d middle = low + 0.5 * size;
  constexpr int kRound = 96;
  constexpr std::array<double, 9> kOut{-6.0, 4.0, 40.0, 80.0, 130.0, 190.0, 260.0, 340.0, 430.0};
  std::vector<Eigen::Vector3f> points;
  for (const double out : kOut) {
    for (int i = 0; i <= kRound; ++i) {
      // Clockwise, so that outwards comes next on the left.
      const double angle = -2.0 * std::numbers::pi * (i % kRound) / kRound;
      const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
      const double scale = 1.0 / std::max(std::abs(direction.x()) / (0.5 * size.x()),
                                          std::abs(direction.y()) / (0.5 * size.y()));
      const Eigen::Vector2d p = middle + (scale + out) * direction;
      const double rise = std::max(out - 20.0, 0.0);
      const double hills =
          0.5 + 0.3 * std::sin(3.0 * angle + 0.01 * out) + 0.2 * std::sin(7.0 * angle + 1.0);
      const double sink = out < 0.0 ? -0.25 : kCampusKerbHeight;
      points.emplace_back(
          Eigen::Vector3d(p.x(), p.y(), ground.terrain().HeightAt(p) + sink + 0.12 * rise * hills)
              .cast<float>());
    }
  }
  constexpr int kNearRows = 3;
  constexpr int kColumns = kRound + 1;
  const std::span<const Eigen::Vector3f> all(points);
  builder.AddGrid(
      all.first(kNearRows * kColumns), kNearRows, kColumns, materials.meadow, kTileGrass);
  builder.AddGrid(all.subspan((kNearRows - 1) * kColumns),
                  static_cast<int>(kOut.size()) - kNearRows + 1,
                  kColumns,
                  materials.hills,
                  46.0F);
}

}  // namespace

void AddSurfaces(const CampusGround& ground,
                 const CampusMaterials& materials,
                 const RoadNetwork& network,
                 Scene& scene) {
  GroundCutter cutter(ground, materials, network);
  cutter.Cut();
  cutter.MoveTo(scene);
  MeshBuilder kerbs;
  for (const RoadContour& contour : ground.roads().Contours(0.0))
    AddKerb(ground, materials, contour, kerbs);
  scene.instances.push_back({.mesh = scene.AddMesh(kerbs.Take())});
  MeshBuilder country;
  AddCountry(ground, materials, country);
  scene.instances.push_back({.mesh = scene.AddMesh(country.Take())});
}

}  // namespace relocd
