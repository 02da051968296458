#include "simulation/wheel_motion.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "simulation/smooth_trajectory.h"

namespace relocd {
namespace {

/// How far a wheel rolls for each metre that B's origin moves, in the plane, negative where it
/// turns the other way round. Front wheels are steered to roll without moving sideways.
double RollPerMetre(const Eigen::Vector2d& p_BK, double curvature_per_m) {
  const Eigen::Vector2d motion(1.0 - curvature_per_m * p_BK.y(), curvature_per_m * p_BK.x());
  return std::copysign(motion.norm(), motion.x());
}

/// The four wheels along a plan, over the ground.
class WheelsOnGround {
 public:
  WheelsOnGround(const DrivePlan& plan, const Ground& ground, const VehicleGeometry& geometry)
      : plan_(plan),
        ground_(ground),
        wheelbase_m_(geometry.wheelbase_m),
        p_BKs_(geometry.WheelsInBody()),
        state_(plan.At(0)) {
    for (std::size_t i = 0; i < kWheels; ++i)
      heights_m_.at(i) = ground_.HeightAlong(state_.X_WB * p_BKs_.at(i), state_.X_WB.yaw());
  }

  void RollTo(std::int64_t time_ns) {
    const DrivePlan::State next = plan_.At(time_ns);
    for (std::size_t i = 0; i < kWheels; ++i) {
      const double plane_m = PlaneTravel(p_BKs_.at(i), next);
      const double height_m = ground_.HeightAlong(next.X_WB * p_BKs_.at(i), next.X_WB.yaw());
      travel_m_.at(i) += std::copysign(std::hypot(plane_m, height_m - heights_m_.at(i)), plane_m);
      heights_m_.at(i) = height_m;
    }
    state_ = next;
  }

  [[nodiscard]] WheelMotion Motion(std::int64_t time_ns) const {
    return {.time_ns = time_ns,
            .X_WB = state_.X_WB,
            .travel_m = travel_m_,
            .steering_rad = std::atan(wheelbase_m_ * state_.curvature_per_m),
            .yaw_rate_radps = state_.yaw_rate_radps(),
            .acceleration_mps2 = state_.acceleration_mps2,
            .lateral_acceleration_mps2 = state_.lateral_acceleration_mps2()};
  }

  [[nodiscard]] const std::array<double, kWheels>& travel_m() const { return travel_m_; }

 private:
  /// How far a wheel rolls until the next state, as seen from above.
  [[nodiscard]] double PlaneTravel(const Eigen::Vector2d& p_BK,
                                   const DrivePlan::State& next) const {
    const double travel_m = next.travel_m - state_.travel_m;
    // The rear axle's is known without integrating.
    if (p_BK.x() == 0.0) return travel_m - (next.heading_rad - state_.heading_rad) * p_BK.y();
    return 0.5 * travel_m *
           (RollPerMetre(p_BK, state_.curvature_per_m) + RollPerMetre(p_BK, next.curvature_per_m));
  }

  const DrivePlan& plan_;
  const Ground& ground_;
  double wheelbase_m_;
  std::array<Eigen::Vector2d, kWheels> p_BKs_;
  DrivePlan::State state_;
  std::array<double, kWheels> heights_m_{};
  std::array<double, kWheels> travel_m_{};
};

/// The four wheels along a trajectory in the plane.
class WheelsOnPlane {
 public:
  WheelsOnPlane(const SmoothTrajectory& trajectory, const VehicleGeometry& geometry)
      : trajectory_(trajectory),
        wheelbase_m_(geometry.wheelbase_m),
        p_BKs_(geometry.WheelsInBody()),
        X_WB_(trajectory.At(trajectory.begin_ns())) {}

  void RollTo(std::int64_t time_ns) {
    const Pose2 X_WBj = trajectory_.At(time_ns);
    const Eigen::Vector3d twist = (X_WB_.Inverse() * X_WBj).Log();
    for (std::size_t i = 0; i < kWheels; ++i) {
      const double forward_m = twist.x() - twist.z() * p_BKs_.at(i).y();
      const double roll_m = std::hypot(forward_m, twist.z() * p_BKs_.at(i).x());
      travel_m_.at(i) += std::copysign(roll_m, forward_m);
    }
    X_WB_ = X_WBj;
  }

  [[nodiscard]] WheelMotion Motion(std::int64_t time_ns) const {
    constexpr std::int64_t kReachNs = 1'000'000;
    const double step_s = 2e-9 * static_cast<double>(kReachNs);
    const auto twist_at = [&](std::int64_t at_ns) -> Eigen::Vector3d {
      const Pose2 X_BiBj =
          trajectory_.At(at_ns - kReachNs).Inverse() * trajectory_.At(at_ns + kReachNs);
      return X_BiBj.Log() / step_s;
    };
    const Eigen::Vector3d twist = twist_at(time_ns);
    WheelMotion motion{.time_ns = time_ns, .X_WB = X_WB_, .travel_m = travel_m_};
    motion.yaw_rate_radps = twist.z();
    motion.lateral_acceleration_mps2 = twist.x() * twist.z();
    motion.acceleration_mps2 =
        (twist_at(time_ns + kReachNs).x() - twist_at(time_ns - kReachNs).x()) / step_s;
    // A wheel that stands tells no direction.
    if (twist.x() != 0.0) motion.steering_rad = std::atan(wheelbase_m_ * twist.z() / twist.x());
    return motion;
  }

  [[nodiscard]] const std::array<double, kWheels>& travel_m() const { return travel_m_; }

 private:
  const SmoothTrajectory& trajectory_;
  double wheelbase_m_;
  std::array<Eigen::Vector2d, kWheels> p_BKs_;
  Pose2 X_WB_;
  std::array<double, kWheels> travel_m_{};
};

/// Times to follow wheels at.
struct Schedule {
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;
  std::int64_t period_ns = 0;
};

template <typename Wheels>
std::vector<WheelMotion> Follow(Wheels& wheels, const Schedule& schedule) {
  std::vector<WheelMotion> motions;
  const std::int64_t half_ns = schedule.period_ns / 2;
  std::array<double, kWheels> before_m = wheels.travel_m();
  for (std::int64_t time_ns = schedule.begin_ns; time_ns <= schedule.end_ns;
       time_ns += schedule.period_ns) {
    wheels.RollTo(time_ns - half_ns / 2);
    wheels.RollTo(time_ns);
    motions.push_back(wheels.Motion(time_ns));
    wheels.RollTo(time_ns + half_ns / 2);
    wheels.RollTo(time_ns + half_ns);
    // Nothing moves before the begin and after the end.
    const std::int64_t span_ns = std::min(time_ns + half_ns, schedule.end_ns) -
                                 std::max(time_ns - half_ns, schedule.begin_ns);
    for (std::size_t i = 0; i < kWheels && span_ns > 0; ++i) {
      motions.back().speeds_mps.at(i) =
          (wheels.travel_m().at(i) - before_m.at(i)) / (static_cast<double>(span_ns) * 1e-9);
    }
    before_m = wheels.travel_m();
  }
  return motions;
}

}  // namespace

std::vector<WheelMotion> RollWheels(const DrivePlan& plan,
                                    const Ground& ground,
                                    const VehicleGeometry& geometry,
                                    std::int64_t period_ns) {
  WheelsOnGround wheels(plan, ground, geometry);
  return Follow(wheels,
                Schedule{.begin_ns = 0, .end_ns = plan.duration_ns(), .period_ns = period_ns});
}

std::vector<WheelMotion> RollWheels(const Trajectory2& X_WBs,
                                    const VehicleGeometry& geometry,
                                    std::int64_t period_ns) {
  const SmoothTrajectory trajectory(X_WBs);
  WheelsOnPlane wheels(trajectory, geometry);
  const std::int64_t begin_ns = (trajectory.begin_ns() + 999) / 1000 * 1000;
  return Follow(
      wheels,
      Schedule{.begin_ns = begin_ns, .end_ns = trajectory.end_ns(), .period_ns = period_ns});
}

}  // namespace relocd
