#include "simulation/campus_roads.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/check.h"

namespace relocd {
namespace {

constexpr double kCornerRadius = 7.0;     // Of kerbs at junctions.
constexpr double kRightTurnRadius = 8.9;  // Concentric with those, in the right-hand lane.
constexpr double kLeftTurnRadius = 10.5;
constexpr double kTurnRadius = 6.4;   // Of the way round the turning circle.
constexpr double kSwingRadius = 9.5;  // With which it is entered and left.
constexpr int kSmoothingPasses = 8;   // Corners of the steering spread over some 2 m.

// A street that starts at another one's kerb starts here from its middle line: its round end just
// touches the kerb.
constexpr double kStreetStart = 2.0 * kStreetHalfWidth;

struct TownSize {
  double width = 0.0;   // Of the block, east to west.
  double height = 0.0;  // South to north.
  double spur_x = 0.0;
  double side_x = 0.0;
  double drive_x = 0.0;
};

TownSize DrawSize(CampusRandom& random) {
  TownSize size;
  size.width = random.Uniform(140.0, 152.0);
  size.height = random.Uniform(82.0, 90.0);
  size.spur_x = size.width * random.Uniform(0.40, 0.48);
  size.side_x = size.width * random.Uniform(0.50, 0.56);
  size.drive_x = size.width * random.Uniform(0.28, 0.33);
  return size;
}

PlaneLine MainLine(const TownSize& size, CampusRandom& random) {
  // Straight near the junctions, with a bend of some metres between.
  const double bend = random.Uniform(1.8, 3.0) * (random.Chance(0.5) ? 1.0 : -1.0);
  const double x = 0.5 * (size.spur_x + size.width);
  const std::array<RoundedCorner, 6> corners{{
      {{-78.0, random.Uniform(-9.0, 9.0)}, 0.0},
      {{-28.0, 0.0}, 120.0},
      {{size.spur_x + 17.0, 0.0}, 90.0},
      {{x, bend}, 75.0},
      {{size.width - 17.0, 0.0}, 90.0},
      {{size.width + 76.0, 0.0}, 0.0},
  }};
  return RoundedLine(corners);
}

PlaneLine RingLine(const TownSize& size, CampusRandom& random) {
  const double lean = random.Uniform(-3.0, 3.0);
  const std::array<RoundedCorner, 6> corners{{
      {{size.width, kStreetStart}, 0.0},
      {{size.width, 24.0}, 90.0},
      {{size.width + lean, size.height}, 14.0},
      {{size.width * 0.72, size.height + random.Uniform(1.0, 5.0)}, 120.0},
      {{22.0, size.height}, 120.0},
      {{-72.0, size.height}, 0.0},
  }};
  return RoundedLine(corners);
}

PlaneLine WestLine(const TownSize& size, CampusRandom& random) {
  const std::array<RoundedCorner, 5> corners{{
      {{0.0, size.height - kStreetStart}, 0.0},
      {{0.0, size.height - 22.0}, 90.0},
      {{random.Uniform(-2.5, 2.5), 0.5 * size.height}, 120.0},
      {{0.0, 20.0}, 90.0},
      {{0.0, -72.0}, 0.0},
  }};
  return RoundedLine(corners);
}

PlaneLine SpurLine(const TownSize& size, double length, double lean) {
  const std::array<RoundedCorner, 4> corners{{
      {{size.spur_x, -kStreetStart}, 0.0},
      {{size.spur_x, -22.0}, 100.0},
      {{size.spur_x + lean, -0.68 * length}, 100.0},
      {{size.spur_x + lean, -length}, 0.0},
  }};
  return RoundedLine(corners);
}

/// Nothing but the point a street would start at, if it began in the middle of the other.
PlaneLine Extended(PlaneLine line, double metres) {
  const Eigen::Vector2d start = line.front() - metres * (line[1] - line[0]).normalized();
  line.insert(line.begin(), start);
  return line;
}

PlaneLine RightLane(const PlaneLine& line) {
  return OffsetLine(line, -kLaneOffset);
}

PlaneLine Joined(const PlaneLine& first, const PlaneLine& second, double radius_m) {
  auto joined = JoinedLines(first, second, radius_m);
  RELOCD_CHECK(joined.has_value(), "lanes that meet at a junction must cross");
  return *std::move(joined);
}

/// The way down the spur, round its turning circle, and back up.
PlaneLine SpurLane(const PlaneLine& spur) {
  const PlaneLine middle = Extended(spur, kStreetStart + 6.0);
  const LinePlace end = PlaceOnLine(middle, 1e9);
  const Eigen::Vector2d right = -end.left();
  // A circle that touches the lane from its right and the turn from outside.
  const double across = kLaneOffset + kSwingRadius;
  const double along = std::sqrt(std::pow(kSwingRadius + kTurnRadius, 2.0) - across * across);
  const double swing = std::acos(across / (kSwingRadius + kTurnRadius));
  PlaneLine lane = PartOfLine(RightLane(middle), 0.0, LineLength(middle) - along);
  const auto append = [&](const Eigen::Vector2d& centre, double radius, double from, double to) {
    const int steps = static_cast<int>(std::ceil(std::abs(to - from) * radius / 0.5));
    for (int i = 1; i <= steps; ++i) {
      const double angle = from + (to - from) * i / steps;
      lane.emplace_back(centre +
                        radius * (std::cos(angle) * right + std::sin(angle) * end.forward));
    }
  };
  const double pi = std::numbers::pi;
  append(end.p_W + across * right - along * end.forward, kSwingRadius, pi, pi - swing);
  append(end.p_W, kTurnRadius, -swing, pi + swing);
  append(end.p_W - across * right - along * end.forward, kSwingRadius, swing, 0.0);
  const PlaneLine back = PartOfLine(RightLane(ReversedLine(middle)), along, LineLength(middle));
  lane.insert(lane.end(), back.begin() + 1, back.end());
  return Resampled(lane, 0.5, false);
}

Path MakeRoute(const RoadNetwork& network) {
  const PlaneLine ring = Extended(network.ring, kStreetStart + 6.0);
  const PlaneLine west = Extended(network.west, kStreetStart + 6.0);
  const PlaneLine main = RightLane(network.main);
  const PlaneLine spur = SpurLane(network.spur);
  const double spur_x = network.spur.front().x();
  // From the middle of the first stretch of the main street once round to the same place.
  const double start = NearestDistanceAlong(main, {0.45 * spur_x, 0.0});
  const double after_spur = NearestDistanceAlong(main, {spur_x, 0.0});
  const double length = LineLength(main);
  PlaneLine line = Joined(PartOfLine(main, start, length), spur, kRightTurnRadius);
  line = Joined(line, PartOfLine(main, after_spur, length), kRightTurnRadius);
  line = Joined(line, RightLane(ring), kLeftTurnRadius);
  line = Joined(line, RightLane(west), kLeftTurnRadius);
  // The way along the first stretch was driven already: the lanes cross once more at its start.
  line = Joined(line, PartOfLine(main, 0.0, start), kLeftTurnRadius);
  line.pop_back();
  line = Resampled(SmoothedLine(std::move(line), kSmoothingPasses, true), 0.5, true);
  return {.points = std::move(line), .is_closed = true};
}

/// The oncoming lane once round the block, and two ways through the crossing in the west.
std::vector<Path> MakeTraffic(const RoadNetwork& network) {
  const PlaneLine main_back = RightLane(ReversedLine(network.main));
  const PlaneLine west_back = RightLane(ReversedLine(Extended(network.west, kStreetStart + 6.0)));
  const PlaneLine ring_back = RightLane(ReversedLine(Extended(network.ring, kStreetStart + 6.0)));
  const double start = NearestDistanceAlong(main_back, {0.6 * network.spur.front().x(), 0.0});
  PlaneLine loop =
      Joined(PartOfLine(main_back, start, LineLength(main_back)), west_back, kRightTurnRadius);
  loop = Joined(loop, ring_back, kRightTurnRadius);
  loop = Joined(loop, PartOfLine(main_back, 0.0, start), kRightTurnRadius);
  loop.pop_back();
  loop = Resampled(SmoothedLine(std::move(loop), kSmoothingPasses, true), 0.5, true);
  const auto open = [](PlaneLine line) {
    return Path{
        .points = Resampled(SmoothedLine(std::move(line), kSmoothingPasses, false), 0.5, false),
        .is_closed = false};
  };
  const double crossing = NearestDistanceAlong(network.main, {0.0, 0.0});
  return {{.points = std::move(loop), .is_closed = true},
          open(Joined(RightLane(PartOfLine(network.main, 4.0, crossing + 8.0)),
                      RightLane(network.west),
                      kRightTurnRadius)),
          open(Joined(PartOfLine(west_back, 4.0, LineLength(west_back)),
                      PartOfLine(main_back, LineLength(network.main) - crossing - 8.0, 1e9),
                      kLeftTurnRadius))};
}

std::vector<ParkingBay> MakeBays(const TownSize& size,
                                 const RoadNetwork& network,
                                 CampusRandom& random) {
  const double crossing = NearestDistanceAlong(network.main, {0.0, 0.0});
  const double side = NearestDistanceAlong(network.ring, {size.side_x, size.height});
  const auto along_main = [&](double x) { return crossing + x; };
  std::vector<ParkingBay> bays{
      {0, StreetSide::kLeft, along_main(22.0 + random.Uniform(0.0, 4.0)), 4},
      {0, StreetSide::kRight, along_main(17.0 + random.Uniform(0.0, 3.0)), 3},
      {0, StreetSide::kLeft, along_main(size.spur_x + 22.0 + random.Uniform(0.0, 5.0)), 4},
      {0, StreetSide::kRight, along_main(-58.0), 4},
      {0, StreetSide::kLeft, along_main(size.width + 22.0), 4},
      {1, StreetSide::kRight, 20.0 + random.Uniform(0.0, 4.0), 5},
      {1, StreetSide::kLeft, side + size.side_x + 18.0, 5},
      {2, StreetSide::kRight, 19.0 + random.Uniform(0.0, 3.0), 5},
      {2, StreetSide::kLeft, size.height + 18.0, 5},
      {3, StreetSide::kLeft, 16.0 + random.Uniform(0.0, 3.0), 4},
      {4, StreetSide::kRight, 18.0, 4},
  };
  return bays;
}

double SideSign(StreetSide side) {
  return side == StreetSide::kLeft ? 1.0 : -1.0;
}

PlaneLine BayLine(const RoadNetwork& network, const ParkingBay& bay) {
  const PlaneLine& street = *network.Streets()[bay.street];
  const PlaneLine part = PartOfLine(street, bay.from_m, bay.from_m + bay.spots * kBaySpotLength);
  return OffsetLine(part, SideSign(bay.side) * (kStreetHalfWidth + 0.5 * kBayWidth));
}

void AddBaySpots(RoadNetwork& network) {
  for (const ParkingBay& bay : network.bays) {
    const PlaneLine line = BayLine(network, bay);
    for (int i = 0; i < bay.spots; ++i) {
      const LinePlace place = PlaceOnLine(line, (i + 0.5) * kBaySpotLength);
      const Eigen::Vector2d forward = -SideSign(bay.side) * place.forward;
      network.parking_spots.emplace_back(
          place.p_W.x(), place.p_W.y(), std::atan2(forward.y(), forward.x()));
    }
  }
}

/// Two rows of spots across the lot, with the way between them.
void AddLotSpots(RoadNetwork& network) {
  constexpr double kSpotWidth = 2.6;
  constexpr double kSpotLength = 5.2;
  for (double x = network.lot_low.x() + 0.5 * kSpotWidth;
       x + 0.5 * kSpotWidth <= network.lot_high.x() + 1e-9;
       x += kSpotWidth) {
    const double quarter = 0.5 * std::numbers::pi;
    network.parking_spots.emplace_back(x, network.lot_low.y() + 0.5 * kSpotLength, quarter);
    // The way in comes through the northern row.
    if (std::abs(x - network.drive.back().x()) > 4.5)
      network.parking_spots.emplace_back(x, network.lot_high.y() - 0.5 * kSpotLength, -quarter);
  }
}

/// What is left for the spur when the route shall have the length that was drawn.
void AddSpur(const TownSize& size, CampusRandom& random, RoadNetwork& network) {
  const double wanted = random.Uniform(638.0, 676.0);
  const double lean = random.Uniform(-5.0, 5.0);
  double length = 80.0;
  for (int i = 0; i < 3; ++i) {
    network.spur = SpurLine(size, length, lean);
    network.route = MakeRoute(network);
    PlaneLine closed = network.route.points;
    closed.push_back(closed.front());
    length += 0.5 * (wanted - LineLength(closed));
  }
}

}  // namespace

bool RoadNetwork::IsPavedAt(const Eigen::Vector2d& p_W) const {
  return p_W.x() > 3.0 && p_W.x() < spur.front().x() + 4.0 && std::abs(p_W.y()) < 16.0;
}

RoadNetwork MakeRoadNetwork(CampusRandom random) {
  const TownSize size = DrawSize(random);
  RoadNetwork network;
  network.main = MainLine(size, random);
  network.ring = RingLine(size, random);
  network.west = WestLine(size, random);
  const double ring_y =
      PlaceOnLine(network.ring, NearestDistanceAlong(network.ring, {size.side_x, size.height}))
          .p_W.y();
  const std::array<RoundedCorner, 3> side{{
      {{size.side_x, ring_y + kStreetStart}, 0.0},
      {{size.side_x, ring_y + 30.0}, 80.0},
      {{size.side_x + random.Uniform(-12.0, 12.0), ring_y + 74.0}, 0.0},
  }};
  network.side_north = RoundedLine(side);
  network.lot_low = {size.drive_x - 15.6, size.height - 35.0};
  network.lot_high = network.lot_low + Eigen::Vector2d(31.2, 17.0);
  network.drive = Resampled(
      {{size.drive_x, size.height - kStreetStart}, {size.drive_x, network.lot_high.y() - 1.0}},
      0.5,
      false);
  AddSpur(size, random, network);
  network.bays = MakeBays(size, network, random);
  network.traffic = MakeTraffic(network);
  AddBaySpots(network);
  AddLotSpots(network);
  network.junctions = {{0.0, 0.0},
                       {size.spur_x, 0.0},
                       {size.width, 0.0},
                       {size.side_x, ring_y},
                       {size.drive_x, size.height},
                       {0.0, size.height}};
  return network;
}

RoadField MakeRoadField(const RoadNetwork& network) {
  constexpr int kMargin = 36;
  const Eigen::Vector2d low(network.main.front().x(),
                            std::min(network.west.back().y(), network.spur.back().y()));
  const Eigen::Vector2d high(network.main.back().x(), network.side_north.back().y());
  RoadField field(low.array().floor().cast<int>() - kMargin,
                  high.array().ceil().cast<int>() + kMargin);
  const auto add = [&field](const PlaneLine& line, double half_width, double corner_radius) {
    field.AddStrip(Resampled(line, 1.0, false), half_width, corner_radius);
  };
  add(network.main, kStreetHalfWidth, kCornerRadius);
  add(network.west, kStreetHalfWidth, kCornerRadius);
  add(network.ring, kStreetHalfWidth, kCornerRadius);
  add(network.spur, kStreetHalfWidth, kCornerRadius);
  add(network.side_north, kStreetHalfWidth, kCornerRadius);
  add(network.drive, 2.8, 5.0);
  const Eigen::Vector2d end = network.spur.back();
  add({end, end + Eigen::Vector2d(0.01, 0.0)}, kTurningRadius, kCornerRadius);
  // Strips have round ends: narrow ones leave little of the lot's corners out.
  constexpr double kLotStrip = 1.5;
  for (double y = network.lot_low.y() + kLotStrip - 0.2;;
       y = std::min(y + kLotStrip, network.lot_high.y() - kLotStrip + 0.2)) {
    add({{network.lot_low.x() + kLotStrip - 0.5, y}, {network.lot_high.x() - kLotStrip + 0.5, y}},
        kLotStrip,
        0.1);
    if (y >= network.lot_high.y() - kLotStrip + 0.2) break;
  }
  for (const ParkingBay& bay : network.bays)
    add(BayLine(network, bay), 0.5 * kBayWidth, 1.5);
  return field;
}

}  // namespace relocd
