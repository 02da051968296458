#pragma once

#include <numbers>
#include <random>

#include "geometry/pose2.h"

namespace relocd {

/// Draws test inputs, the same ones in every run.
class TestRandom {
 public:
  explicit TestRandom(unsigned seed) : engine_(seed) {}

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Eigen::Vector2d Point() { return {Uniform(-10.0, 10.0), Uniform(-10.0, 10.0)}; }
  Pose2 Pose() {
    return {
        Uniform(-10.0, 10.0), Uniform(-10.0, 10.0), Uniform(-std::numbers::pi, std::numbers::pi)};
  }

 private:
  std::mt19937 engine_;
};

}  // namespace relocd
