#include "simulation/campus_ground.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace relocd {
namespace {

// Metres from one crest to the next, and the slope that each wave has at most. The sum keeps below
// the 3 % that a campus has.
constexpr std::array<double, 4> kWavelengths{310.0, 190.0, 120.0, 75.0};
constexpr std::array<double, 4> kSlopes{0.013, 0.009, 0.005, 0.002};

// Over which a kerb rises.
constexpr double kKerbWidth = 0.03;

}  // namespace

CampusTerrain::CampusTerrain(CampusRandom random) {
  for (std::size_t i = 0; i < waves_.size(); ++i) {
    const double direction = random.Uniform(0.0, 2.0 * std::numbers::pi);
    const double wave_number = 2.0 * std::numbers::pi / kWavelengths.at(i);
    waves_.at(i) = {
        .wave_number = wave_number * Eigen::Vector2d(std::cos(direction), std::sin(direction)),
        .phase = random.Uniform(0.0, 2.0 * std::numbers::pi),
        .amplitude = kSlopes.at(i) / wave_number};
  }
}

double CampusTerrain::HeightAt(const Eigen::Vector2d& p_W) const {
  double height = 0.0;
  for (const Wave& wave : waves_)
    height += wave.amplitude * std::sin(wave.wave_number.dot(p_W) + wave.phase);
  return height;
}

CampusGround::CampusGround(const CampusTerrain& terrain, RoadField roads)
    : terrain_(terrain), roads_(std::move(roads)) {}

double CampusGround::HeightAt(const Eigen::Vector2d& p_W) const {
  const double beside = roads_.DistanceAt(p_W);
  return terrain_.HeightAt(p_W) + kCampusKerbHeight * std::clamp(beside / kKerbWidth, 0.0, 1.0);
}

Eigen::Vector3f CampusGround::PointAt(const Eigen::Vector2d& p_W, double above_m) const {
  return Eigen::Vector3d(p_W.x(), p_W.y(), HeightAt(p_W) + above_m).cast<float>();
}

}  // namespace relocd
