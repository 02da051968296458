#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "simulation/campus_pictures.h"
#include "simulation/campus_textures.h"
#include "simulation/campus_town.h"

namespace relocd {
namespace {

constexpr double kLampSpacing = 25.0;
constexpr double kLampGap = 0.5;  // From the kerb.

class SceneryBuilder {
 public:
  SceneryBuilder(const CampusStock& stock, CampusRandom random, CampusSite& site)
      : stock_(stock), random_(random), site_(site) {}

  void Add() {
    const RoadNetwork& n = site_.network();
    AddLamps(n.main, StreetSide::kRight);
    AddLamps(n.ring, StreetSide::kLeft);
    AddLamps(n.west, StreetSide::kRight);
    AddLamps(n.spur, StreetSide::kRight);
    AddLamps(n.side_north, StreetSide::kLeft);
    AddTurningCircleLamp();
    AddSigns();
    AddShoppingStreet();
    AddAlleyHedge();
    AddTurningCircleFence();
    AddNorthAvenue();
    AddPark();
    AddLotBorder();
    for (const PlaneLine* const street : n.Streets())
      AddStreetThings(*street);
    AddWires();
    AddTufts();
    AddWoods();
  }

 private:
  Eigen::Vector2d AnyDirection() {
    const double angle = random_.Uniform(0.0, 2.0 * std::numbers::pi);
    return {std::cos(angle), std::sin(angle)};
  }

  void AddLamp(const KerbPlace& place) {
    site_.Place(stock_.furniture.lamp_post, place.p_W, place.to_road);
    Lamp lamp;
    const Eigen::Vector2d head = static_cast<double>(kLampHead.x()) * place.to_road;
    lamp.p_WL = site_.ground().PointAt(place.p_W, static_cast<double>(kLampHead.z()));
    lamp.p_WL.head<2>() += head.cast<float>();
    lamp.intensity = {26.0F, 20.0F, 12.5F};
    lamp.cone_cosine = 0.25F;
    site_.scene().lamps.push_back(lamp);
    site_.Take({.centre = place.p_W, .half_size = {0.3, 0.3}});
  }

  void AddLamps(const PlaneLine& street, StreetSide side) {
    for (double s = 9.0; s < LineLength(street); s += kLampSpacing) {
      const auto place = site_.BesideStreet(street, side, s, kLampGap);
      if (place) AddLamp(*place);
    }
  }

  void AddTurningCircleLamp() {
    const LinePlace end = PlaceOnLine(site_.network().spur, 1e9);
    const Eigen::Vector2d p_W = end.p_W + (kTurningRadius + kLampGap) * end.forward;
    AddLamp({p_W, -end.forward, end.left()});
  }

  /// Puts something at the kerb if there is room.
  void AddAtKerb(
      std::uint32_t mesh, const PlaneLine& street, StreetSide side, double s, double gap) {
    const auto place = site_.BesideStreet(street, side, s, gap);
    if (!place || !site_.IsFree(place->p_W, 0.3, 0.2)) return;
    site_.Place(mesh, place->p_W, place->to_road);
    site_.Take({.centre = place->p_W, .half_size = {0.35, 0.35}});
  }

  /// A sign that faces those who come along the street in its direction, on their right.
  void AddSign(TrafficSign sign, const PlaneLine& street, double s) {
    const auto place = site_.BesideStreet(street, StreetSide::kRight, s, 0.55);
    if (!place) return;
    site_.Place(
        stock_.furniture.signs.at(static_cast<std::size_t>(sign)), place->p_W, -place->along);
    site_.Take({.centre = place->p_W, .half_size = {0.3, 0.3}});
  }

  void AddSigns() {
    const RoadNetwork& n = site_.network();
    const double crossing = NearestDistanceAlong(n.main, {0.0, 0.0});
    const double spur = NearestDistanceAlong(n.main, n.junctions[1]);
    const double corner = NearestDistanceAlong(n.main, n.junctions[2]);
    const double side = NearestDistanceAlong(n.ring, n.junctions[3]);
    const double lot = NearestDistanceAlong(n.ring, n.junctions[4]);
    const double west = NearestDistanceAlong(n.west, {0.0, 0.0});
    const auto back = [](const PlaneLine& line) { return ReversedLine(line); };
    AddSign(TrafficSign::kDeadEnd, n.spur, 8.5);
    AddSign(TrafficSign::kLimit30, n.main, crossing + 13.0);
    AddSign(TrafficSign::kCrossing, n.main, spur + 11.0);
    AddSign(TrafficSign::kPriority, n.main, spur - 16.0);
    AddSign(TrafficSign::kParking, n.ring, lot - 14.0);
    AddSign(TrafficSign::kLimit30, n.ring, 12.0);
    AddSign(TrafficSign::kCrossing, n.ring, side + 11.0);
    AddSign(TrafficSign::kNoEntry, n.ring, NearestDistanceAlong(n.ring, n.junctions[5]) + 16.0);
    AddSign(TrafficSign::kGiveWay, n.west, west - 12.0);
    AddSign(TrafficSign::kPriority, n.main, corner - 16.0);
    AddSign(TrafficSign::kStop, back(n.spur), LineLength(n.spur) - 4.0);
    AddSign(TrafficSign::kGiveWay, back(n.side_north), LineLength(n.side_north) - 4.5);
    AddSign(TrafficSign::kStop, back(n.ring), LineLength(n.ring) - 4.5);
    AddSign(TrafficSign::kGiveWay, back(n.west), LineLength(n.west) - west - 12.0);
    AddSign(TrafficSign::kLimit30, back(n.main), LineLength(n.main) - corner - 20.0);
  }

  void AddShoppingStreet() {
    const RoadNetwork& n = site_.network();
    const double from = NearestDistanceAlong(n.main, {0.0, 0.0}) + 12.0;
    const double to = NearestDistanceAlong(n.main, n.junctions[1]) - 12.0;
    for (double s = from; s < to; s += 7.0) {
      const std::array<std::uint32_t, 5> things{stock_.furniture.planter,
                                                stock_.furniture.bin,
                                                stock_.furniture.bollard,
                                                stock_.furniture.letter_box,
                                                stock_.furniture.bicycle_stand};
      for (const StreetSide side : {StreetSide::kLeft, StreetSide::kRight}) {
        const std::uint32_t thing = random_.Pick(things);
        if (thing == stock_.furniture.bicycle_stand) {
          AddBicycles(n.main, side, s);
        } else {
          AddAtKerb(thing, n.main, side, s + random_.Uniform(-2.0, 2.0), 0.62);
        }
      }
    }
    const auto column =
        site_.BesideStreet(n.main, StreetSide::kLeft, from + 0.62 * (to - from), 1.0);
    if (column) site_.Place(stock_.furniture.advertising_column, column->p_W, column->to_road);
    const double shelter = NearestDistanceAlong(n.main, n.junctions[1]) + 26.0;
    AddShelter(n.main, StreetSide::kRight, shelter);
  }

  void AddShelter(const PlaneLine& street, StreetSide side, double s) {
    const auto place = site_.BesideStreet(street, side, s, 2.0);
    if (!place ||
        !site_.IsFree({.centre = place->p_W, .along = place->along, .half_size = {2.2, 0.7}}, 0.6))
      return;
    site_.Place(stock_.furniture.shelter, place->p_W, place->to_road);
    site_.Take({.centre = place->p_W, .along = place->along, .half_size = {2.3, 1.0}});
  }

  void AddBicycles(const PlaneLine& street, StreetSide side, double s) {
    const auto place = site_.BesideStreet(street, side, s, 1.0);
    if (!place) return;
    const SiteRectangle rectangle{
        .centre = place->p_W, .along = place->along, .half_size = {1.6, 0.8}};
    if (!site_.IsFree(rectangle, 0.15)) return;
    const Eigen::Vector2d left(-place->to_road.y(), place->to_road.x());
    site_.Place(stock_.furniture.bicycle_stand, place->p_W - 1.2 * left, place->to_road);
    site_.Take(rectangle);
  }

  /// A long hedge with nothing else, which looks the same for tens of metres.
  void AddAlleyHedge() {
    const PlaneLine& spur = site_.network().spur;
    for (double s = 9.0; s < 38.0; s += 2.0) {
      const auto a = site_.BesideStreet(spur, StreetSide::kRight, s, kSidewalkWidth + 0.5);
      const auto b = site_.BesideStreet(spur, StreetSide::kRight, s + 2.0, kSidewalkWidth + 0.5);
      if (a && b) site_.PlaceFence(stock_.plants.hedge, a->p_W, b->p_W);
    }
    for (double s = 14.0; s < 38.0; s += 8.0) {
      const auto place = site_.BesideStreet(spur, StreetSide::kRight, s, kSidewalkWidth + 4.5);
      if (place) PlaceTree(TreeKind::kBirch, place->p_W, 2.5);
    }
  }

  void PlaceTree(TreeKind kind, const Eigen::Vector2d& p_W, double to_road_m) {
    if (!site_.IsFree(p_W, 0.5, to_road_m)) return;
    site_.Place(random_.Pick(stock_.plants.Trees(kind)),
                p_W,
                AnyDirection(),
                0.0,
                random_.Uniform(0.88F, 1.12F));
    site_.Take({.centre = p_W, .half_size = {0.5, 0.5}});
  }

  /// Back gardens behind the houses round the turning circle, which close the view.
  void AddTurningCircleFence() {
    constexpr double kRadius = kTurningRadius + kSidewalkWidth + 8.5;
    const LinePlace end = PlaceOnLine(site_.network().spur, 1e9);
    const auto at = [&end](double angle, double radius) -> Eigen::Vector2d {
      return end.p_W + radius * (std::cos(angle) * end.forward + std::sin(angle) * end.left());
    };
    constexpr double kStep = 2.0 / kRadius;
    for (double angle = -1.95; angle < 1.95; angle += kStep) {
      if (site_.IsFree(at(angle + 0.5 * kStep, kRadius), 1.0, kSidewalkWidth + 1.0))
        site_.PlaceFence(
            stock_.furniture.board_fence, at(angle, kRadius), at(angle + kStep, kRadius));
    }
    for (double angle = -1.9; angle < 1.95; angle += 0.21) {
      const auto kind = random_.Chance(0.5)
                            ? TreeKind::kLime
                            : (random_.Chance(0.5) ? TreeKind::kSpruce : TreeKind::kBirch);
      PlaceTree(
          kind, at(angle + random_.Uniform(-0.06, 0.06), kRadius + random_.Uniform(2.0, 7.0)), 6.0);
    }
  }

  /// Equal trees before a fence all along the street: few features.
  void AddNorthAvenue() {
    const RoadNetwork& n = site_.network();
    const double from = NearestDistanceAlong(n.ring, n.junctions[3]) + 12.0;
    const double to = NearestDistanceAlong(n.ring, n.junctions[5]) + 4.0;
    const std::uint32_t tree = stock_.plants.Trees(TreeKind::kLime)[1];
    for (double s = from; s < to; s += 2.0) {
      const auto a = site_.BesideStreet(n.ring, StreetSide::kRight, s, kSidewalkWidth + 0.4);
      const auto b = site_.BesideStreet(n.ring, StreetSide::kRight, s + 2.0, kSidewalkWidth + 0.4);
      if (a && b) site_.PlaceFence(stock_.furniture.rail_fence, a->p_W, b->p_W);
    }
    for (double s = from + 3.0; s < to; s += 9.0) {
      const auto place = site_.BesideStreet(n.ring, StreetSide::kRight, s, kSidewalkWidth + 2.6);
      if (!place || !site_.IsFree(place->p_W, 0.5, 2.5)) continue;
      site_.Place(tree, place->p_W, place->to_road);
      site_.Take({.centre = place->p_W, .half_size = {0.5, 0.5}});
    }
  }

  void AddPark() {
    const RoadNetwork& n = site_.network();
    const double east = n.ring.front().x();
    const double north = n.junctions[4].y();
    const Eigen::Vector2d low(n.lot_high.x() + 8.0, n.lot_low.y() - 8.0);
    const Eigen::Vector2d high(east - 6.5, north - 6.5);
    const Eigen::Vector2d centre = 0.5 * (low + high);
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector2d p_W{random_.Uniform(low.x(), high.x()),
                                random_.Uniform(low.y(), high.y())};
      const auto kind =
          std::array{TreeKind::kPlane, TreeKind::kLime, TreeKind::kBirch, TreeKind::kSpruce}.at(
              random_.Index(4));
      if ((p_W - centre).norm() < 7.0 || !site_.IsFree(p_W, 2.2, kSidewalkWidth + 2.0)) continue;
      PlaceTree(kind, p_W, kSidewalkWidth + 1.5);
      site_.Take({.centre = p_W, .half_size = {2.0, 2.0}});
    }
    for (int i = 0; i < 6; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / 6.0;
      const Eigen::Vector2d out(std::cos(angle), std::sin(angle));
      site_.Place(stock_.furniture.bench, centre + 5.0 * out, -out);
      if (i % 2 == 0)
        site_.Place(stock_.furniture.bin,
                    centre + 5.0 * Eigen::Vector2d(std::cos(angle + 0.3), std::sin(angle + 0.3)),
                    -out);
    }
    site_.Place(stock_.furniture.advertising_column, centre, Eigen::Vector2d::UnitX());
    // Benches and low hedges along the streets.
    const double lot = NearestDistanceAlong(n.ring, {high.x() - 4.0, north});
    const double end = NearestDistanceAlong(n.ring, {low.x() + 2.0, north});
    for (double s = lot; s < end; s += 2.0) {
      const auto a = site_.BesideStreet(n.ring, StreetSide::kLeft, s, kSidewalkWidth + 0.45);
      const auto b = site_.BesideStreet(n.ring, StreetSide::kLeft, s + 2.0, kSidewalkWidth + 0.45);
      if (a && b && static_cast<int>(s - lot) % 16 < 12)
        site_.PlaceFence(stock_.plants.low_hedge, a->p_W, b->p_W);
      if (a && static_cast<int>(s - lot) % 16 == 13)
        site_.Place(stock_.furniture.bench, a->p_W, a->to_road);
    }
  }

  void AddLotBorder() {
    const RoadNetwork& n = site_.network();
    const Eigen::Vector2d low = n.lot_low - Eigen::Vector2d::Constant(3.2);
    const Eigen::Vector2d high = n.lot_high + Eigen::Vector2d(3.2, 0.0);
    site_.PlaceFence(stock_.plants.low_hedge, {low.x(), low.y()}, {high.x(), low.y()});
    site_.PlaceFence(stock_.furniture.board_fence, {low.x(), low.y()}, {low.x(), high.y()});
    site_.PlaceFence(stock_.plants.low_hedge, {high.x(), low.y()}, {high.x(), high.y()});
    for (double x = low.x() + 3.0; x < high.x(); x += 8.0)
      PlaceTree(TreeKind::kYoung, {x, low.y() - 1.5}, 2.5);
    AddLamp({{n.lot_low.x() + 8.0, n.lot_low.y() - kLampGap},
             Eigen::Vector2d::UnitY(),
             Eigen::Vector2d::UnitX()});
    AddLamp({{n.lot_high.x() - 8.0, n.lot_low.y() - kLampGap},
             Eigen::Vector2d::UnitY(),
             Eigen::Vector2d::UnitX()});
  }

  /// Boxes, bins and young trees here and there.
  void AddStreetThings(const PlaneLine& street) {
    const double length = LineLength(street);
    for (double s = random_.Uniform(6.0, 14.0); s < length; s += random_.Uniform(9.0, 19.0)) {
      const StreetSide side = random_.Chance(0.5) ? StreetSide::kLeft : StreetSide::kRight;
      const double kind = random_.Unit<double>();
      if (kind < 0.2) {
        AddAtKerb(stock_.furniture.cabinet, street, side, s, kSidewalkWidth - 0.35);
      } else if (kind < 0.35) {
        AddAtKerb(stock_.furniture.bin, street, side, s, 0.5);
      } else if (kind < 0.45) {
        AddAtKerb(stock_.furniture.letter_box, street, side, s, 0.6);
      } else if (kind < 0.8) {
        const auto place = site_.BesideStreet(street, side, s, 0.75);
        if (place) PlaceTree(TreeKind::kYoung, place->p_W, 0.6);
      } else {
        for (int i = 0; i < 3; ++i)
          AddAtKerb(stock_.furniture.bollard, street, side, s + 1.5 * i, 0.35);
      }
    }
  }

  /// Poles along one side of the western and eastern streets, with wires that sag.
  void AddWires() {
    const RoadNetwork& n = site_.network();
    AddWiresAlong(n.west, StreetSide::kLeft, 10.0, LineLength(n.west) - 10.0);
    AddWiresAlong(n.ring, StreetSide::kRight, 12.0, 70.0);
  }

  void AddWiresAlong(const PlaneLine& street, StreetSide side, double from, double to) {
    std::vector<KerbPlace> poles;
    for (double s = from; s < to; s += 27.0) {
      const auto place = site_.BesideStreet(street, side, s, 1.95);
      if (!place || !site_.IsFree(place->p_W, 0.25, 1.0)) continue;
      site_.Place(stock_.furniture.wire_pole, place->p_W, place->along);
      site_.Take({.centre = place->p_W, .half_size = {0.3, 0.3}});
      poles.push_back(*place);
    }
    MeshBuilder wires;
    for (std::size_t i = 0; i + 1 < poles.size(); ++i) {
      for (const double across : {-0.8, 0.0, 0.8})
        AddWire(WireEnd(poles[i], across), WireEnd(poles[i + 1], across), wires);
    }
    if (!wires.empty())
      site_.scene().instances.push_back({.mesh = site_.scene().AddMesh(wires.Take())});
  }

  [[nodiscard]] Eigen::Vector3f WireEnd(const KerbPlace& pole, double across) const {
    const Eigen::Vector2d left(-pole.along.y(), pole.along.x());
    Eigen::Vector3f end = site_.ground().PointAt(pole.p_W, 7.27);
    end.head<2>() += (across * left).cast<float>();
    return end;
  }

  void AddWire(const Eigen::Vector3f& from, const Eigen::Vector3f& to, MeshBuilder& wires) const {
    constexpr int kParts = 10;
    constexpr float kSag = 0.55F;
    constexpr float kThickness = 0.016F;
    Eigen::Vector3f last = from;
    for (int i = 1; i <= kParts; ++i) {
      const float part = static_cast<float>(i) / kParts;
      Eigen::Vector3f next = from + part * (to - from);
      next.z() -= 4.0F * kSag * part * (1.0F - part);
      const Eigen::Vector3f side =
          kThickness * (to - from).cross(Eigen::Vector3f::UnitZ()).normalized();
      wires.AddQuad(last, next - last, {0.0F, 0.0F, kThickness}, stock_.materials.dark_metal);
      wires.AddQuad(last, next - last, side, stock_.materials.dark_metal);
      last = next;
    }
  }

  /// Grass that grows out of lawns near streets.
  void AddTufts() {
    for (const PlaneLine* const street : site_.network().Streets()) {
      for (double s = 2.0; s < LineLength(*street); s += 1.7) {
        for (const StreetSide side : {StreetSide::kLeft, StreetSide::kRight}) {
          const double gap = kSidewalkWidth + random_.Uniform(0.9, 4.5);
          const auto place = site_.BesideStreet(*street, side, s, gap);
          if (place && !site_.network().IsPavedAt(place->p_W) &&
              site_.IsFree(place->p_W, 1.3, kSidewalkWidth + 0.7))
            site_.Place(random_.Pick(stock_.plants.tufts), place->p_W, AnyDirection());
        }
      }
    }
  }

  /// Trees behind the gardens, so that the town ends in green.
  void AddWoods() {
    const RoadField& field = site_.field();
    const Eigen::Vector2d low = field.low().cast<double>();
    const Eigen::Vector2d high = field.high().cast<double>();
    for (int i = 0; i < 820; ++i) {
      const Eigen::Vector2d p_W{random_.Uniform(low.x() - 40.0, high.x() + 40.0),
                                random_.Uniform(low.y() - 40.0, high.y() + 40.0)};
      const auto kind = std::array{TreeKind::kLime,
                                   TreeKind::kPlane,
                                   TreeKind::kSpruce,
                                   TreeKind::kPoplar,
                                   TreeKind::kBirch}
                            .at(random_.Index(5));
      const float size = random_.Uniform(0.95F, 1.5F);
      const bool is_inside = p_W.x() > 0.0 && p_W.x() < site_.network().ring.front().x() &&
                             p_W.y() > 0.0 && p_W.y() < site_.network().junctions[4].y();
      if (is_inside || !site_.IsFree(p_W, 2.0, 14.0)) continue;
      site_.Place(random_.Pick(stock_.plants.Trees(kind)), p_W, AnyDirection(), -0.2, size);
    }
  }

  const CampusStock& stock_;
  CampusRandom random_;
  CampusSite& site_;
};

}  // namespace

void AddScenery(const CampusStock& stock, CampusRandom random, CampusSite& site) {
  SceneryBuilder(stock, random, site).Add();
}

}  // namespace relocd
