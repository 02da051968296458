#pragma once

#include <cstdint>
#include <vector>

#include "core/counter_random.h"
#include "rendering/ray_tracer.h"
#include "rendering/scene.h"
#include "simulation/session.h"
#include "simulation/world.h"

namespace relocd {

/// The cars that are parked in a session: which of the world's spots are taken, and by what.
std::vector<MeshInstance> ParkedCars(const World& world, const Session& session);

/// The cars and people that move in a session, each along one of the world's paths, back and forth
/// or round. Immutable, hence thread-safe. Borrows the world, which must outlive it.
class MovingActors {
 public:
  MovingActors(const World& world, const Session& session, std::uint64_t seed);

  /// Where they are during an exposure. Times since the drive's begin.
  [[nodiscard]] std::vector<MovingMesh> During(double begin_s, double end_s) const;

  [[nodiscard]] std::size_t size() const { return actors_.size(); }

 private:
  struct Actor {
    std::size_t path = 0;  ///< Index into paths_.
    std::uint32_t mesh = 0;
    double start_m = 0.0;
    double speed_mps = 0.0;  ///< Negative: against the path's direction.
    double aside_m = 0.0;    ///< To the left of the path.
  };
  /// A path with the distance to each of its points.
  struct MeasuredPath {
    const Path* path = nullptr;
    std::vector<double> distances_m;  ///< One more than points for a closed path.
    [[nodiscard]] double length_m() const { return distances_m.back(); }
  };

  /// Those of one kind: cars, or people.
  struct Kind {
    const std::vector<std::uint32_t>& meshes;
    double per_km;
    double speed_mps;
    bool walks;  ///< Both ways, each at a pace and a place of its own.
  };

  void AddActors(const std::vector<Path>& paths, const Kind& kind, std::uint64_t seed);
  void AddActorsOnLastPath(const Kind& kind, const CounterRandom& random, std::uint64_t& counter);
  static MeasuredPath Measure(const Path& path);
  [[nodiscard]] Eigen::Affine3f PlaceOf(const Actor& actor, double time_s) const;

  const World& world_;
  std::vector<MeasuredPath> paths_;
  std::vector<Actor> actors_;
};

}  // namespace relocd
