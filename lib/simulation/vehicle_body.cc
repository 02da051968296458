#include "simulation/vehicle_body.h"

#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>

#include <fmt/format.h>

namespace relocd {
namespace {

constexpr double kRoughPitchRad = 0.4 * std::numbers::pi / 180.0;  // rms, at a roughness of 1
constexpr double kRoughRollRad = 0.4 * std::numbers::pi / 180.0;
constexpr double kRoughHeightM = 0.004;
/// Shorter bumps are under a tyre all at once; longer ones are the ground's own shape.
constexpr double kShortestBumpM = 0.9;
constexpr double kLongestBumpM = 12.0;

}  // namespace

std::array<Eigen::Vector2d, 4> VehicleGeometry::WheelsInBody() const {
  return {Eigen::Vector2d(0.0, 0.5 * track_m),
          Eigen::Vector2d(0.0, -0.5 * track_m),
          Eigen::Vector2d(wheelbase_m, 0.5 * track_m),
          Eigen::Vector2d(wheelbase_m, -0.5 * track_m)};
}

Result<void> VehicleBodyOptions::Validate() const {
  struct Field {
    const char* name;
    double value;
    double high;
  };
  for (const Field& field : {Field{"roughness", roughness, 20.0},
                             Field{"pitch_rad_per_mps2", pitch_rad_per_mps2, 0.1},
                             Field{"roll_rad_per_mps2", roll_rad_per_mps2, 0.1}}) {
    if (!(field.value >= 0.0 && field.value <= field.high)) {
      return Error{
          ErrorKind::kInvalidInput,
          fmt::format("{} is {}, must be in [0, {}]", field.name, field.value, field.high)};
    }
  }
  return {};
}

VehicleBody::VehicleBody(const DrivePlan& plan,
                         const Ground& ground,
                         const VehicleGeometry& geometry,
                         const VehicleBodyOptions& options)
    : plan_(plan), ground_(ground), geometry_(geometry), options_(options) {
  std::mt19937_64 engine(options.seed);
  std::uniform_real_distribution<double> uniform;
  for (std::size_t i = 0; i < kBumps; ++i) {
    const double part = (static_cast<double>(i) + uniform(engine)) / kBumps;
    const double length_m = kShortestBumpM * std::pow(kLongestBumpM / kShortestBumpM, part);
    bumps_.at(i).radians_per_m = 2.0 * std::numbers::pi / length_m;
    for (double& phase_rad : bumps_.at(i).phases_rad)
      phase_rad = 2.0 * std::numbers::pi * uniform(engine);
  }
}

Eigen::Vector3d VehicleBody::RoughnessAt(double travel_m) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Bump& bump : bumps_) {
    for (std::size_t i = 0; i < bump.phases_rad.size(); ++i)
      sum[static_cast<Eigen::Index>(i)] +=
          std::sin(bump.radians_per_m * travel_m + bump.phases_rad.at(i));
  }
  return sum * std::sqrt(2.0 / kBumps);  // a sine has a mean square of 1/2
}

Pose3 VehicleBody::At(std::int64_t time_ns) const {
  const DrivePlan::State state = plan_.At(time_ns);
  std::array<double, 4> heights_m{};
  const std::array<Eigen::Vector2d, 4> wheels = geometry_.WheelsInBody();
  for (std::size_t i = 0; i < wheels.size(); ++i)
    heights_m.at(i) = ground_.HeightAlong(state.X_WB * wheels.at(i), state.X_WB.yaw());
  const double rear_m = 0.5 * (heights_m[0] + heights_m[1]);
  const double front_m = 0.5 * (heights_m[2] + heights_m[3]);
  const double left_m = 0.5 * (heights_m[0] + heights_m[2]);
  const double right_m = 0.5 * (heights_m[1] + heights_m[3]);

  const Eigen::Vector3d rough = options_.roughness * RoughnessAt(state.travel_m);
  // About y, which points left, a positive angle lowers the nose; about x it raises the left side.
  const double pitch_rad = std::atan2(rear_m - front_m, geometry_.wheelbase_m) -
                           options_.pitch_rad_per_mps2 * state.acceleration_mps2 +
                           kRoughPitchRad * rough.x();
  const double roll_rad = std::atan2(left_m - right_m, geometry_.track_m) +
                          options_.roll_rad_per_mps2 * state.lateral_acceleration_mps2() +
                          kRoughRollRad * rough.y();
  const double z_m = rear_m + kRoughHeightM * rough.z();
  return {RotationFromRollPitchYaw(roll_rad, pitch_rad, state.heading_rad),
          Eigen::Vector3d(state.X_WB.x(), state.X_WB.y(), z_m)};
}

}  // namespace relocd
