#pragma once

#include <cmath>
#include <numbers>

#include "simulation/world.h"

namespace relocd {

/// Two straights of 80 m and two half circles of 12 m radius, to the left.
inline Path OvalRoute() {
  constexpr double kStraightM = 80.0;
  constexpr double kRadiusM = 12.0;
  constexpr double kStepM = 1.0;
  Path route{.points = {}, .is_closed = true};
  const auto add_side = [&](double sign) {
    for (double x = 0.0; x < kStraightM; x += kStepM)
      route.points.emplace_back(sign * (x - 0.5 * kStraightM), -sign * kRadiusM);
    constexpr int kBendSteps = 36;
    for (int i = 0; i < kBendSteps; ++i) {
      const double angle_rad = std::numbers::pi * (static_cast<double>(i) / kBendSteps - 0.5);
      route.points.emplace_back(sign * (0.5 * kStraightM + kRadiusM * std::cos(angle_rad)),
                                sign * kRadiusM * std::sin(angle_rad));
    }
  };
  add_side(1.0);
  add_side(-1.0);
  return route;
}

inline double OvalLength_m() {
  return 160.0 + 2.0 * std::numbers::pi * 12.0;
}

/// A plane that rises along x.
class SlopedGround final : public Ground {
 public:
  explicit SlopedGround(double slope) : slope_(slope) {}
  [[nodiscard]] double HeightAt(const Eigen::Vector2d& p_W) const override {
    return slope_ * p_W.x();
  }

 private:
  double slope_;
};

}  // namespace relocd
