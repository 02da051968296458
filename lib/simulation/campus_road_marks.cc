#include "simulation/campus_road_marks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "rendering/mesh_builder.h"
#include "simulation/campus_pictures.h"
#include "simulation/campus_textures.h"

namespace relocd {
namespace {

// Each kind lies a little above what it may cover.
constexpr double kPatchAbove = 0.004;
constexpr double kCrackAbove = 0.006;
constexpr double kPaintAbove = 0.008;
constexpr double kDetailAbove = 0.010;

/// Lays flat things onto the road.
class RoadPainter {
 public:
  RoadPainter(const CampusGround& ground, const CampusMaterials& materials)
      : ground_(ground), materials_(materials) {}

  [[nodiscard]] const RoadField& field() const { return ground_.roads(); }
  [[nodiscard]] const CampusMaterials& materials() const { return materials_; }
  Mesh Take() { return builder_.Take(); }

  /// A strip along a line between two distances from its start.
  void AddStripe(const PlaneLine& line, double from, double to, double width) {
    const int parts = std::max(1, static_cast<int>(std::ceil((to - from) / 1.5)));
    for (int i = 0; i < parts; ++i) {
      const LinePlace a = PlaceOnLine(line, from + (to - from) * i / parts);
      const LinePlace b = PlaceOnLine(line, from + (to - from) * (i + 1) / parts);
      AddTiled({a.p_W - 0.5 * width * a.left(),
                b.p_W - 0.5 * width * b.left(),
                b.p_W + 0.5 * width * b.left(),
                a.p_W + 0.5 * width * a.left()},
               kPaintAbove,
               materials_.road_paint,
               2.7F);
    }
  }

  /// Four corners counter-clockwise; the texture keeps its scale.
  void AddTiled(const std::array<Eigen::Vector2d, 4>& corners,
                double above,
                std::uint32_t material,
                float tile) {
    const auto uv = [&](const Eigen::Vector2d& p) -> Eigen::Vector2f {
      return p.cast<float>() / tile;
    };
    AddFour(
        corners, above, {uv(corners[0]), uv(corners[1]), uv(corners[2]), uv(corners[3])}, material);
  }

  /// A picture of `size` metres, upright where `place` goes.
  void AddDetail(const LinePlace& place,
                 const Eigen::Vector2d& size,
                 const PicturePart& part,
                 std::uint32_t material) {
    const Eigen::Vector2d ahead = 0.5 * size.y() * place.forward;
    const Eigen::Vector2d left = 0.5 * size.x() * place.left();
    const double above = material == materials_.cracks ? kCrackAbove : kDetailAbove;
    const Eigen::Vector2f low(part.low.x(), 1.0F - part.low.y());
    const Eigen::Vector2f high(part.high.x(), 1.0F - part.high.y());
    AddFour({place.p_W - ahead + left,
             place.p_W - ahead - left,
             place.p_W + ahead - left,
             place.p_W + ahead + left},
            above,
            {low, {high.x(), low.y()}, high, {low.x(), high.y()}},
            material);
  }

  /// A band of tar.
  void AddBand(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double width) {
    const Eigen::Vector2d step = to - from;
    if (step.norm() < 1e-6) return;
    const Eigen::Vector2d left = 0.5 * width * Eigen::Vector2d(-step.y(), step.x()).normalized();
    // A little longer, so that bands join.
    const Eigen::Vector2d more = 0.25 * width * step.normalized();
    AddTiled({from - more - left, to + more - left, to + more + left, from - more + left},
             kCrackAbove,
             materials_.tar,
             kTileAsphalt);
  }

  void AddPatch(const LinePlace& place, const Eigen::Vector2d& size) {
    const Eigen::Vector2d ahead = 0.5 * size.y() * place.forward;
    const Eigen::Vector2d left = 0.5 * size.x() * place.left();
    AddTiled({place.p_W - ahead + left,
              place.p_W - ahead - left,
              place.p_W + ahead - left,
              place.p_W + ahead + left},
             kPatchAbove,
             materials_.asphalt_new,
             kTileAsphalt);
  }

 private:
  void AddFour(const std::array<Eigen::Vector2d, 4>& corners,
               double above,
               const std::array<Eigen::Vector2f, 4>& uvs,
               std::uint32_t material) {
    // Wholly on the road or wholly on the sidewalk.
    const Eigen::Vector2d middle = 0.5 * (corners[0] + corners[2]);
    const double level = above + (field().DistanceAt(middle) > 0.1 ? kCampusKerbHeight : 0.0);
    std::array<Eigen::Vector3f, 4> p;
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d& q = corners.at(i);
      p.at(i) = Eigen::Vector3d(q.x(), q.y(), ground_.terrain().HeightAt(q) + level).cast<float>();
    }
    builder_.AddTriangle({p[0], p[1], p[2]}, {uvs[0], uvs[1], uvs[2]}, material);
    builder_.AddTriangle({p[0], p[2], p[3]}, {uvs[0], uvs[2], uvs[3]}, material);
  }

  const CampusGround& ground_;
  const CampusMaterials& materials_;
  MeshBuilder builder_;
};

bool IsNearJunction(const RoadNetwork& network, const Eigen::Vector2d& p_W, double reach) {
  return std::any_of(
      network.junctions.begin(), network.junctions.end(), [&](const Eigen::Vector2d& junction) {
        return (junction - p_W).norm() < reach;
      });
}

void AddCentreLine(const RoadNetwork& network, const PlaneLine& street, RoadPainter& painter) {
  const double length = LineLength(street);
  for (double s = 3.0; s + 6.0 < length; s += 6.0) {
    if (!IsNearJunction(network, PlaceOnLine(street, s + 1.5).p_W, 15.0))
      painter.AddStripe(street, s, s + 3.0, 0.12);
  }
}

/// A thick line across the right-hand lane of those who come to a junction, `before` metres ahead
/// of it, or of all lanes.
void AddStopLine(const PlaneLine& street, double at, RoadPainter& painter) {
  const LinePlace place = PlaceOnLine(street, at);
  painter.AddStripe(
      {place.p_W - 0.15 * place.left(), place.p_W - (kStreetHalfWidth - 0.35) * place.left()},
      0.0,
      kStreetHalfWidth - 0.5,
      0.4);
}

void AddZebra(const PlaneLine& street, double at, RoadPainter& painter) {
  const LinePlace place = PlaceOnLine(street, at);
  for (double across = -kStreetHalfWidth + 0.6; across < kStreetHalfWidth - 0.3; across += 1.0) {
    const Eigen::Vector2d p = place.p_W + across * place.left();
    painter.AddStripe({p - 1.5 * place.forward, p + 1.5 * place.forward}, 0.0, 3.0, 0.5);
  }
}

void AddJunctionMarks(const RoadNetwork& network, RoadPainter& painter) {
  const PlaneLine spur_up = ReversedLine(network.spur);
  const PlaneLine side_down = ReversedLine(network.side_north);
  constexpr double kBack = 3.6;  // From the end of a street's line to its stop line.
  AddStopLine(spur_up, LineLength(spur_up) - kBack, painter);
  AddStopLine(side_down, LineLength(side_down) - kBack, painter);
  AddStopLine(ReversedLine(network.ring), LineLength(network.ring) - kBack, painter);
  AddStopLine(ReversedLine(network.west), LineLength(network.west) - kBack, painter);
  const double crossing = NearestDistanceAlong(network.west, {0.0, 0.0});
  AddStopLine(network.west, crossing - 10.6, painter);
  AddStopLine(ReversedLine(network.west), LineLength(network.west) - crossing - 10.6, painter);
  const double spur_x = network.spur.front().x();
  AddZebra(network.main, NearestDistanceAlong(network.main, {0.27 * spur_x, 0.0}) - 2.0, painter);
  AddZebra(network.main, NearestDistanceAlong(network.main, {spur_x + 14.5, 0.0}), painter);
  AddZebra(network.ring, NearestDistanceAlong(network.ring, network.junctions[3]) + 14.5, painter);
  AddZebra(network.west, 13.5, painter);
}

void AddBayMarks(const RoadNetwork& network, RoadPainter& painter) {
  for (const ParkingBay& bay : network.bays) {
    const PlaneLine& street = *network.Streets()[bay.street];
    const double sign = bay.side == StreetSide::kLeft ? 1.0 : -1.0;
    for (int i = 0; i <= bay.spots; ++i) {
      const LinePlace place = PlaceOnLine(street, bay.from_m + i * kBaySpotLength);
      const Eigen::Vector2d out = sign * place.left();
      painter.AddStripe({place.p_W + (kStreetHalfWidth + 0.1) * out,
                         place.p_W + (kStreetHalfWidth + kBayWidth - 0.35) * out},
                        0.0,
                        1.75,
                        0.1);
    }
  }
  const double south = network.lot_low.y();
  const double north = network.lot_high.y();
  for (double x = network.lot_low.x(); x <= network.lot_high.x() + 0.01; x += 2.6) {
    painter.AddStripe({{x, south + 0.35}, {x, south + 5.2}}, 0.0, 4.85, 0.1);
    if (std::abs(x - network.drive.back().x()) > 3.0)
      painter.AddStripe({{x, north - 5.2}, {x, north - 0.35}}, 0.0, 4.85, 0.1);
  }
}

Eigen::Vector2d PlaceBeside(const PlaneLine& street, double s, double across) {
  const LinePlace place = PlaceOnLine(street, s);
  return place.p_W + across * place.left();
}

/// What traffic and repairs have left along a street.
void AddWear(const PlaneLine& street, CampusRandom& random, RoadPainter& painter) {
  const double length = LineLength(street);
  const auto place_at = [&](double s, double across, double turn) {
    LinePlace place = PlaceOnLine(street, s);
    place.p_W += across * place.left();
    const double c = std::cos(turn);
    const double n = std::sin(turn);
    place.forward = Eigen::Vector2d(c * place.forward.x() - n * place.forward.y(),
                                    n * place.forward.x() + c * place.forward.y());
    return place;
  };
  for (double s = random.Uniform(2.0, 9.0); s < length - 3.0; s += random.Uniform(3.0, 8.5)) {
    const double across = random.Uniform(-2.3, 2.3);
    const double kind = random.Unit<double>();
    const double turn = random.Uniform(-0.12, 0.12);
    const double spin = random.Uniform(0.0, 6.28);
    const double size = random.Uniform(0.8, 2.2);
    if (kind < 0.24) {
      painter.AddPatch(place_at(s, 0.6 * across, turn), {size, random.Uniform(1.0, 3.4)});
    } else if (kind < 0.62) {
      const double large = 1.4 * size + 0.6;
      painter.AddDetail(
          place_at(s, 0.6 * across, spin), {large, large}, {}, painter.materials().cracks);
    } else if (kind < 0.78) {
      painter.AddDetail(place_at(s, 0.7 * across, spin),
                        {0.68, 0.68},
                        kRoadDetails.Part(0),
                        painter.materials().road_details);
    } else {
      painter.AddDetail(place_at(s, 0.8 * across, spin),
                        {size, size},
                        kRoadDetails.Part(2 + random.Index(2)),
                        painter.materials().road_details);
    }
  }
  // Where a cable was laid along or across.
  for (double s = random.Uniform(15.0, 40.0); s < length - 20.0; s += random.Uniform(30.0, 60.0)) {
    const double across = random.Uniform(-2.2, 2.2);
    if (random.Chance(0.5)) {
      for (double along = 0.0; along < 9.0; along += 1.5)
        painter.AddPatch(place_at(s + along, across, 0.0), {0.45, 1.52});
    } else {
      painter.AddPatch(place_at(s, 0.0, 0.0), {5.9, 0.5});
    }
  }
}

/// Cracks that were sealed with tar: narrow dark bands that wander.
void AddSealedCracks(const PlaneLine& street, CampusRandom& random, RoadPainter& painter) {
  for (double s = random.Uniform(5.0, 15.0); s + 12.0 < LineLength(street);
       s += random.Uniform(9.0, 22.0)) {
    double across = random.Uniform(-2.8, 2.8);
    const bool is_along = random.Chance(0.6);
    const double drift = across > 0.0 ? -0.3 : 0.3;
    const int parts = 6 + static_cast<int>(random.Index(12));
    Eigen::Vector2d last = PlaceBeside(street, s, across);
    for (int i = 1; i < parts; ++i) {
      const double ahead =
          is_along ? 0.5 * i + random.Uniform(-0.12, 0.12) : random.Uniform(-0.2, 0.2);
      across = std::clamp(across + (is_along ? random.Uniform(-0.16, 0.16) : drift), -2.9, 2.9);
      const Eigen::Vector2d next = PlaceBeside(street, s + ahead, across);
      painter.AddBand(last, next, random.Uniform(0.05, 0.09));
      last = next;
    }
  }
}

/// Covers, stains and mended places of sidewalks.
void AddSidewalkDetails(const PlaneLine& street, CampusRandom& random, RoadPainter& painter) {
  for (double s = random.Uniform(2.0, 6.0); s < LineLength(street); s += random.Uniform(2.0, 5.0)) {
    const double side = random.Chance(0.5) ? 1.0 : -1.0;
    const double across = side * (kStreetHalfWidth + random.Uniform(0.7, 1.7));
    const double kind = random.Unit<double>();
    const double size = random.Uniform(0.4, 0.9);
    LinePlace place = PlaceOnLine(street, s);
    place.p_W = PlaceBeside(street, s, across);
    const double beside = painter.field().DistanceAt(place.p_W);
    if (beside < 0.65 || beside > 1.8) continue;
    if (kind < 0.3) {
      painter.AddDetail(
          place, {0.5 * size, 0.5 * size}, kRoadDetails.Part(0), painter.materials().road_details);
    } else if (kind < 0.45) {
      painter.AddDetail(place, {0.3, 0.42}, kRoadDetails.Part(1), painter.materials().road_details);
    } else if (kind < 0.75) {
      painter.AddDetail(place,
                        {size, size},
                        kRoadDetails.Part(2 + random.Index(2)),
                        painter.materials().road_details);
    } else {
      painter.AddPatch(place, {size, 1.6 * size});
    }
  }
}

void AddDrains(const RoadNetwork& network, const PlaneLine& street, RoadPainter& painter) {
  const double length = LineLength(street);
  for (double s = 11.0; s < length - 4.0; s += 24.0) {
    for (const double sign : {-1.0, 1.0}) {
      LinePlace place = PlaceOnLine(street, s);
      place.p_W += sign * (kStreetHalfWidth - 0.22) * place.left();
      const double depth = painter.field().DistanceAt(place.p_W);
      if (depth < -0.3 || depth > -0.1 || IsNearJunction(network, place.p_W, 12.0)) continue;
      painter.AddDetail(place, {0.36, 0.5}, kRoadDetails.Part(1), painter.materials().road_details);
    }
  }
}

}  // namespace

void AddRoadMarks(const CampusGround& ground,
                  const CampusMaterials& materials,
                  const RoadNetwork& network,
                  CampusRandom random,
                  Scene& scene) {
  RoadPainter painter(ground, materials);
  for (const PlaneLine* const street :
       {&network.main, &network.ring, &network.west, &network.side_north})
    AddCentreLine(network, *street, painter);
  AddJunctionMarks(network, painter);
  AddBayMarks(network, painter);
  for (const PlaneLine* const street : network.Streets()) {
    AddWear(*street, random, painter);
    AddSealedCracks(*street, random, painter);
    AddSidewalkDetails(*street, random, painter);
    AddDrains(network, *street, painter);
  }
  scene.instances.push_back({.mesh = scene.AddMesh(painter.Take())});
}

}  // namespace relocd
