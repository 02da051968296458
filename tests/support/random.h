#pragma once

#include <numbers>
#include <random>

#include "geometry/pose2.h"
#include "geometry/pose3.h"

namespace relocd {

/// Draws test inputs, the same ones in every run.
class TestRandom {
 public:
  explicit TestRandom(unsigned seed) : engine_(seed) {}

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double Normal(double sigma) { return sigma * std::normal_distribution<double>()(engine_); }
  int Integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }

  Eigen::Vector2d Point() { return {Uniform(-10.0, 10.0), Uniform(-10.0, 10.0)}; }
  Eigen::Vector3d Point3() { return {Uniform(-10, 10), Uniform(-10, 10), Uniform(-10, 10)}; }
  Pose2 Pose() {
    return {
        Uniform(-10.0, 10.0), Uniform(-10.0, 10.0), Uniform(-std::numbers::pi, std::numbers::pi)};
  }
  /// A uniformly distributed rotation.
  Eigen::Quaterniond Rotation() {
    return Eigen::Quaterniond(Normal(1.0), Normal(1.0), Normal(1.0), Normal(1.0)).normalized();
  }
  Pose3 SpatialPose() { return {Rotation(), Point3()}; }

  std::mt19937& engine() { return engine_; }

 private:
  std::mt19937 engine_;
};

}  // namespace relocd
