#include "simulation/actors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace relocd {
namespace {

constexpr double kCarSpeedMps = 7.0;
constexpr double kWalkingSpeedMps = 1.4;

/// The upright pose on the ground, tilted as the ground is between two points along x.
Eigen::Affine3f StandOnGround(const Ground& ground, const Pose2& X_WM, double length_m) {
  const Eigen::Vector2d ahead(std::cos(X_WM.yaw()), std::sin(X_WM.yaw()));
  const Eigen::Vector2d& at = X_WM.translation();
  const double front = ground.HeightAlong(at + 0.5 * length_m * ahead, X_WM.yaw());
  const double rear = ground.HeightAlong(at - 0.5 * length_m * ahead, X_WM.yaw());
  const double pitch = -std::atan2(front - rear, length_m);
  Eigen::Affine3d result = Eigen::Translation3d(at.x(), at.y(), 0.5 * (front + rear)) *
                           Eigen::AngleAxisd(X_WM.yaw(), Eigen::Vector3d::UnitZ()) *
                           Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY());
  return result.cast<float>();
}

constexpr double kCarLengthM = 2.6;  ///< Between the axles.

}  // namespace

std::vector<MeshInstance> ParkedCars(const World& world, const Session& session) {
  std::vector<MeshInstance> cars;
  if (world.car_meshes.empty()) return cars;
  const CounterRandom random(session.parked_seed);
  for (std::uint64_t i = 0; i < world.parking_spots.size(); ++i) {
    const auto draw = [&](std::uint64_t which) { return random.Unit(8 * i + which); };
    if (draw(0) >= session.parked_part) continue;
    const auto kinds = static_cast<std::uint32_t>(world.car_meshes.size());
    const auto kind =
        CounterRandom::Below(kinds, static_cast<std::uint32_t>(random.Bits(8 * i + 1)));
    // Nobody parks quite straight.
    const Pose2 X_SM(0.5 * (draw(2) - 0.5), 0.2 * (draw(3) - 0.5), 0.06 * (draw(4) - 0.5));
    const Pose2 X_WM = world.parking_spots[i] * X_SM;
    cars.push_back(
        {.mesh = world.car_meshes[kind], .X_WM = StandOnGround(*world.ground, X_WM, kCarLengthM)});
  }
  return cars;
}

MovingActors::MovingActors(const World& world, const Session& session, std::uint64_t seed)
    : world_(world) {
  const Kind cars{.meshes = world.car_meshes,
                  .per_km = session.cars_per_km,
                  .speed_mps = kCarSpeedMps,
                  .walks = false};
  const Kind people{.meshes = world.pedestrian_meshes,
                    .per_km = session.pedestrians_per_km,
                    .speed_mps = kWalkingSpeedMps,
                    .walks = true};
  AddActors(world.traffic, cars, seed);
  AddActors(world.walkways, people, seed + 1);
}

void MovingActors::AddActors(const std::vector<Path>& paths, const Kind& kind, std::uint64_t seed) {
  if (kind.meshes.empty() || !(kind.per_km > 0.0)) return;
  const CounterRandom random(seed ^ 0xAC7025ULL);
  std::uint64_t counter = 0;
  for (const Path& path : paths) {
    if (path.points.size() < 2) continue;
    paths_.push_back(Measure(path));
    AddActorsOnLastPath(kind, random, counter);
  }
}

MovingActors::MeasuredPath MovingActors::Measure(const Path& path) {
  MeasuredPath measured{.path = &path, .distances_m = {0.0}};
  const std::size_t segments = path.points.size() - (path.is_closed ? 0 : 1);
  for (std::size_t i = 0; i < segments; ++i) {
    const Eigen::Vector2d step = path.points[(i + 1) % path.points.size()] - path.points[i];
    measured.distances_m.push_back(measured.length_m() + step.norm());
  }
  return measured;
}

void MovingActors::AddActorsOnLastPath(const Kind& kind,
                                       const CounterRandom& random,
                                       std::uint64_t& counter) {
  const double length_m = paths_.back().length_m();
  const double expected = kind.per_km * length_m * 1e-3;
  const auto count = static_cast<int>(expected + random.Unit(counter++));
  const auto meshes = static_cast<std::uint32_t>(kind.meshes.size());
  for (int i = 0; i < count; ++i) {
    Actor actor{.path = paths_.size() - 1};
    actor.mesh = kind.meshes[CounterRandom::Below(
        meshes, static_cast<std::uint32_t>(random.Bits(counter++)))];
    // Evenly spread, so that they do not drive through each other.
    actor.start_m = length_m * (i + 0.6 * random.Unit(counter++)) / count;
    actor.speed_mps = kind.speed_mps;
    if (kind.walks) {
      actor.speed_mps *= 0.8 + 0.4 * random.Unit(counter++);
      if (random.Unit(counter++) < 0.5F) actor.speed_mps *= -1.0;
      actor.aside_m = 0.8 * (random.Unit(counter++) - 0.5);
    }
    actors_.push_back(actor);
  }
}

Eigen::Affine3f MovingActors::PlaceOf(const Actor& actor, double time_s) const {
  const MeasuredPath& measured = paths_[actor.path];
  const auto& points = measured.path->points;
  const double length_m = measured.length_m();
  double distance_m = std::fmod(actor.start_m + actor.speed_mps * time_s, length_m);
  if (distance_m < 0.0) distance_m += length_m;
  const auto after = std::upper_bound(
      measured.distances_m.begin() + 1, measured.distances_m.end() - 1, distance_m);
  const auto i = static_cast<std::size_t>(after - measured.distances_m.begin()) - 1;
  const Eigen::Vector2d& from = points[i];
  const Eigen::Vector2d step = points[(i + 1) % points.size()] - from;
  const double part = (distance_m - measured.distances_m[i]) /
                      (measured.distances_m[i + 1] - measured.distances_m[i]);
  const Eigen::Vector2d ahead = step.normalized();
  const Eigen::Vector2d at =
      from + part * step + actor.aside_m * Eigen::Vector2d(-ahead.y(), ahead.x());
  const double direction = actor.speed_mps < 0.0 ? -1.0 : 1.0;
  const Pose2 X_WM(at.x(), at.y(), std::atan2(direction * ahead.y(), direction * ahead.x()));
  const bool walks = std::abs(actor.speed_mps) < 0.5 * kCarSpeedMps;
  return StandOnGround(*world_.ground, X_WM, walks ? 0.3 : kCarLengthM);
}

std::vector<MovingMesh> MovingActors::During(double begin_s, double end_s) const {
  std::vector<MovingMesh> moving;
  for (const Actor& actor : actors_) {
    moving.push_back({.mesh = actor.mesh,
                      .X_WM_begin = PlaceOf(actor, begin_s),
                      .X_WM_end = PlaceOf(actor, end_s)});
  }
  return moving;
}

}  // namespace relocd
