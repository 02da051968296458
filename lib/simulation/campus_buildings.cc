#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "rendering/mesh_builder.h"
#include "simulation/campus_houses.h"
#include "simulation/campus_textures.h"
#include "simulation/campus_town.h"

namespace relocd {
namespace {

enum class FrontGarden { kNone, kPicketFence, kLowWall, kHedge, kLowHedge, kOpen };

/// What the houses of a row have in common.
struct RowLook {
  std::vector<HouseKind> kinds;
  double setback_m = 0.0;  ///< Behind the sidewalk.
  double gap_m = 0.0;      ///< Between houses, at least.
  FrontGarden garden = FrontGarden::kNone;
  bool is_equal = false;  ///< All look alike.
};

/// Houses along one side of a street.
struct HouseRow {
  const PlaneLine* street = nullptr;
  StreetSide side = StreetSide::kLeft;
  double from_m = 0.0;
  double to_m = 0.0;
  RowLook look;
};

class RowBuilder {
 public:
  RowBuilder(const CampusStock& stock, CampusRandom random, CampusSite& site)
      : stock_(stock), random_(random), site_(site) {}

  void Add(const HouseRow& row) {
    HouseStyle style = Draw(row);
    std::optional<std::uint32_t> equal_mesh;
    double s = row.from_m;
    while (s + style.width <= row.to_m) {
      const auto place = Fit(row, style, s + 0.5 * style.width);
      if (!place) {
        s += 1.0;
        continue;
      }
      if (!row.look.is_equal || !equal_mesh)
        equal_mesh =
            site_.scene().AddMesh(MakeHouse(style, stock_.materials, random_.Fork(random_.Bits())));
      Build(row, style, *place, *equal_mesh);
      s += style.width + (style.is_attached && row.look.gap_m <= 0.0
                              ? 0.0
                              : row.look.gap_m * random_.Uniform(1.0, 1.8));
      if (!row.look.is_equal) style = Draw(row);
    }
  }

 private:
  HouseStyle Draw(const HouseRow& row) {
    HouseStyle style =
        DrawHouseStyle(random_.Pick(row.look.kinds), stock_.materials, random_, site_.scene());
    // Each shop its own name as long as there are some.
    style.sign = style.ground_floor == GroundFloor::kEntrance ? 23 : next_sign_++ % 23;
    if (row.look.gap_m > 0.0) style.is_attached = false;
    return style;
  }

  /// The rectangle of a house, as near to its place in the row as roads allow.
  std::optional<SiteRectangle> Fit(const HouseRow& row,
                                   const HouseStyle& style,
                                   double centre_m) const {
    const LinePlace place = PlaceOnLine(*row.street, centre_m);
    const Eigen::Vector2d out =
        row.side == StreetSide::kLeft ? place.left() : Eigen::Vector2d(-place.left());
    const double depth = style.depth;
    for (double more = 0.0; more < 3.2; more += 0.1) {
      const double front = kStreetHalfWidth + kSidewalkWidth + row.look.setback_m + more;
      SiteRectangle rectangle{.centre = place.p_W + (front + 0.5 * depth) * out,
                              .along = Eigen::Vector2d(out.y(), -out.x()),
                              .half_size = {0.5 * style.width - 0.15, 0.5 * depth}};
      if (site_.IsFree(rectangle, kSidewalkWidth + 0.8 * row.look.setback_m)) return rectangle;
    }
    return std::nullopt;
  }

  void Build(const HouseRow& row,
             const HouseStyle& style,
             const SiteRectangle& place,
             std::uint32_t mesh) {
    site_.Take(place);
    const Eigen::Vector2d left =
        place.centre - 0.5 * style.width * place.along - 0.5 * style.depth * place.across();
    // As high as the highest ground before it; the foundation reaches down at the other end.
    const CampusGround& ground = site_.ground();
    const double own = ground.HeightAt(left);
    double highest = own;
    for (const double part : {0.25, 0.5, 0.75, 1.0})
      highest = std::max(highest, ground.HeightAt(left + part * style.width * place.along));
    const double above = highest - own - 0.06;
    site_.Place(mesh, left, place.along, above);
    if (row.look.garden != FrontGarden::kNone) AddGarden(row, style, place);
  }

  void AddGarden(const HouseRow& row, const HouseStyle& style, const SiteRectangle& place) {
    const Eigen::Vector2d to_street = -place.across();
    const double depth = row.look.setback_m - 0.35;
    const Eigen::Vector2d front = place.centre - place.half_size.y() * place.across();
    const double half = 0.5 * style.width + 0.4 * row.look.gap_m;
    const double door = static_cast<double>(DoorCentre(style)) - 0.5 * style.width;
    if (style.ground_floor == GroundFloor::kDwelling)
      AddPath(front + door * place.along, to_street, place);
    const Eigen::Vector2d edge = front + depth * to_street;
    if (site_.field().DistanceAt(edge) > kSidewalkWidth + 1.2) return;
    const auto fence = FenceMesh(row.look.garden);
    if (fence) {
      site_.PlaceFence(*fence, edge - half * place.along, edge + (door - 0.65) * place.along);
      site_.PlaceFence(*fence, edge + (door + 0.65) * place.along, edge + half * place.along);
    }
    for (int i = 0; i < 5; ++i) {
      const double x = random_.Uniform(-half, half);
      const double y = random_.Uniform(0.7, std::max(0.8, depth - 0.8));
      const std::uint32_t bush = random_.Pick(stock_.plants.bushes);
      const float size = random_.Uniform(0.5F, 1.0F);
      const double turn = random_.Uniform(0.0, 6.28);
      if (std::abs(x - door) > 1.5 && y < depth - 0.8)
        site_.Place(bush,
                    front + x * place.along + y * to_street,
                    {std::cos(turn), std::sin(turn)},
                    0.0,
                    size);
    }
    if (row.look.setback_m > 3.5 && random_.Chance(0.55)) {
      const double x = (door > 0.0 ? -0.6 : 0.6) * half;
      const auto kind = random_.Chance(0.5) ? TreeKind::kYoung : TreeKind::kBirch;
      site_.Place(random_.Pick(stock_.plants.Trees(kind)),
                  front + x * place.along + 0.55 * depth * to_street,
                  Eigen::Vector2d::UnitX());
    }
  }

  [[nodiscard]] std::optional<std::uint32_t> FenceMesh(FrontGarden garden) const {
    switch (garden) {
      case FrontGarden::kPicketFence:
        return stock_.furniture.picket_fence;
      case FrontGarden::kLowWall:
        return stock_.furniture.low_wall;
      case FrontGarden::kHedge:
        return stock_.plants.hedge;
      case FrontGarden::kLowHedge:
        return stock_.plants.low_hedge;
      default:
        return std::nullopt;
    }
  }

  /// Paving from a door to the sidewalk.
  void AddPath(const Eigen::Vector2d& door,
               const Eigen::Vector2d& to_street,
               const SiteRectangle& place) {
    constexpr double kHalfWidth = 0.6;
    MeshBuilder builder;
    for (double s = 0.0; s < 9.0; s += 1.0) {
      const Eigen::Vector2d p = door + s * to_street;
      if (site_.field().DistanceAt(p + to_street) < kSidewalkWidth - 0.6) break;
      const auto corner = [&](double side, double ahead) {
        return site_.ground().PointAt(p + side * place.along + ahead * to_street, 0.012);
      };
      const Eigen::Vector3f origin = corner(-kHalfWidth, 1.0);
      builder.AddQuad(origin,
                      corner(kHalfWidth, 1.0) - origin,
                      corner(-kHalfWidth, 0.0) - origin,
                      stock_.materials.setts,
                      kTileSetts);
    }
    if (!builder.empty())
      site_.scene().instances.push_back({.mesh = site_.scene().AddMesh(builder.Take())});
  }

  const CampusStock& stock_;
  CampusRandom random_;
  CampusSite& site_;
  std::size_t next_sign_ = 0;
};

/// Where streets meet others, as distances along their lines.
struct StreetDistances {
  explicit StreetDistances(const RoadNetwork& n)
      : crossing(NearestDistanceAlong(n.main, {0.0, 0.0})),
        spur(NearestDistanceAlong(n.main, n.junctions[1])),
        corner(NearestDistanceAlong(n.main, n.junctions[2])),
        side(NearestDistanceAlong(n.ring, n.junctions[3])),
        west(NearestDistanceAlong(n.ring, n.junctions[5])),
        west_crossing(NearestDistanceAlong(n.west, {0.0, 0.0})) {}

  double crossing;       ///< Of `main` with `west`.
  double spur;           ///< On `main`.
  double corner;         ///< Of `main` with `ring`.
  double side;           ///< Of `ring` with the street to the north.
  double west;           ///< Of `ring` with `west`.
  double west_crossing;  ///< Of `west` with `main`.
};

constexpr auto kLeft = StreetSide::kLeft;
constexpr auto kRight = StreetSide::kRight;

std::vector<HouseRow> RowsAlongTheRoute(const RoadNetwork& n) {
  using enum HouseKind;
  using enum FrontGarden;
  const StreetDistances at(n);
  const RowLook shops{{kShop}, 0.0, 0.0, kNone, false};
  const RowLook university{{kCampus}, 4.5, 3.0, kNone, false};
  const RowLook terrace{{kTerrace}, 2.4, 0.0, kLowWall, true};
  const RowLook garages{{kGarages}, 5.5, 1.5, kNone, true};
  const RowLook apartments{{kApartments, kVilla}, 3.2, 3.0, kLowHedge, false};
  const RowLook cottages{{kCottage}, 4.5, 3.0, kPicketFence, false};
  const RowLook corner{{kCottage, kVilla}, 5.0, 4.0, kLowHedge, false};
  const RowLook villas{{kVilla}, 4.0, 3.0, kHedge, false};
  const RowLook mixed{{kVilla, kCottage}, 4.2, 3.5, kLowWall, false};
  const RowLook blocks{{kVilla, kApartments}, 3.0, 3.0, kLowWall, false};
  const double spur_end = LineLength(n.spur);
  return {
      {&n.main, kLeft, at.crossing + 8.0, at.spur + 6.0, shops},
      {&n.main, kRight, at.crossing + 8.0, at.spur - 8.0, shops},
      {&n.main, kLeft, at.spur + 14.0, at.corner - 8.0, university},
      {&n.main, kRight, at.spur + 8.0, at.corner + 12.0, apartments},
      // The blind alley: equal houses on one side, garages behind a hedge on the other.
      {&n.spur, kLeft, 10.0, spur_end - 13.0, terrace},
      {&n.spur, kRight, 40.0, spur_end - 8.0, garages},
      {&n.ring, kRight, 8.0, 62.0, cottages},
      {&n.ring, kLeft, 30.0, 46.0, villas},
      {&n.ring, kRight, 63.0, at.side - 44.0, corner},
      // The north is open on its outer side.
      {&n.ring, kRight, at.side - 42.0, at.side - 7.0, mixed},
      {&n.ring, kLeft, at.west - 36.0, at.west - 6.0, villas},
      {&n.west, kLeft, 8.0, at.west_crossing - 14.0, villas},
      {&n.west, kRight, 4.0, at.west_crossing - 14.0, blocks},
  };
}

/// Along the streets that the route passes.
std::vector<HouseRow> RowsOfSideStreets(const RoadNetwork& n) {
  using enum HouseKind;
  using enum FrontGarden;
  const StreetDistances at(n);
  const RowLook town{{kVilla, kShop, kApartments}, 1.5, 2.0, kOpen, false};
  const RowLook shops{{kShop, kVilla}, 0.5, 1.0, kNone, false};
  const RowLook hedges{{kCottage, kVilla}, 3.5, 3.0, kLowHedge, false};
  const RowLook fences{{kVilla, kCottage}, 3.5, 3.0, kPicketFence, false};
  const RowLook walls{{kVilla, kCottage}, 3.5, 3.0, kLowWall, false};
  const RowLook terraces{{kTerrace, kVilla}, 2.0, 1.0, kLowWall, false};
  const RowLook blocks{{kApartments, kVilla}, 2.5, 3.0, kOpen, false};
  const double main_end = LineLength(n.main);
  const double ring_end = LineLength(n.ring);
  const double west_end = LineLength(n.west);
  const double side_end = LineLength(n.side_north);
  return {
      {&n.main, kLeft, 4.0, at.crossing - 7.0, town},
      {&n.main, kRight, 4.0, at.crossing - 7.0, shops},
      {&n.main, kLeft, at.corner + 9.0, main_end, hedges},
      {&n.main, kRight, at.corner + 14.0, main_end, fences},
      {&n.ring, kLeft, at.west + 9.0, ring_end, walls},
      {&n.ring, kRight, at.west + 12.0, ring_end, fences},
      {&n.west, kLeft, at.west_crossing + 9.0, west_end, terraces},
      {&n.west, kRight, at.west_crossing + 9.0, west_end, blocks},
      {&n.side_north, kLeft, 8.0, side_end, fences},
      {&n.side_north, kRight, 8.0, side_end, hedges},
  };
}

/// What closes the view along the streets that end as scenery.
std::vector<std::pair<const PlaneLine*, HouseKind>> StreetEnds(const RoadNetwork& n) {
  return {{&n.main, HouseKind::kApartments},
          {&n.ring, HouseKind::kVilla},
          {&n.west, HouseKind::kApartments},
          {&n.side_north, HouseKind::kVilla}};
}

void AddStreetEnd(const PlaneLine& street, HouseKind kind, RowBuilder& rows) {
  const LinePlace end = PlaceOnLine(street, 1e9);
  // A row of one house along a line across the end.
  const Eigen::Vector2d middle = end.p_W + 6.0 * end.forward;
  const PlaneLine across =
      Resampled({middle + 16.0 * end.left(), middle - 16.0 * end.left()}, 1.0, false);
  rows.Add({&across, kLeft, 4.0, 28.0, {{kind}, 1.0, 3.0, FrontGarden::kNone, false}});
}

/// Along an arc from which houses stand as far back as along streets.
void AddHousesRoundTurningCircle(const RoadNetwork& network, RowBuilder& rows) {
  const LinePlace end = PlaceOnLine(network.spur, 1e9);
  PlaneLine arc;
  for (double angle = -1.75; angle <= 1.75; angle += 0.05) {
    arc.emplace_back(end.p_W + (kTurningRadius - kStreetHalfWidth) *
                                   (std::cos(angle) * end.forward + std::sin(angle) * end.left()));
  }
  rows.Add({&arc,
            kRight,
            0.0,
            LineLength(arc),
            {{HouseKind::kVilla, HouseKind::kCottage}, 3.4, 1.0, FrontGarden::kLowHedge, false}});
}

}  // namespace

void AddBuildings(const CampusStock& stock, CampusRandom random, CampusSite& site) {
  RowBuilder rows(stock, random, site);
  for (const HouseRow& row : RowsAlongTheRoute(site.network()))
    rows.Add(row);
  for (const HouseRow& row : RowsOfSideStreets(site.network()))
    rows.Add(row);
  for (const auto& [street, kind] : StreetEnds(site.network()))
    AddStreetEnd(*street, kind, rows);
  AddStreetEnd(ReversedLine(site.network().main), HouseKind::kApartments, rows);
  AddHousesRoundTurningCircle(site.network(), rows);
}

}  // namespace relocd
