#include "camera/pinhole_camera.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace relocd {
namespace {

/// Nearer than this a point has no usable direction; nothing that a vehicle's camera sees is.
constexpr double kMinDepth = 1e-6;
/// 89.4 degrees from the axis: no pinhole image reaches further.
constexpr double kMaxRadius = 100.0;

/// d(r * (1 + k1 r^2 + k2 r^4 + k3 r^6)) / dr
double RadialSlope(const std::array<double, 5>& distortion, double radius) {
  const double r2 = radius * radius;
  return 1.0 + r2 * (3.0 * distortion[0] + r2 * (5.0 * distortion[1] + r2 * 7.0 * distortion[4]));
}

/// The radius at which the radial distortion stops to increase, kMaxRadius if it never does.
double FoldRadius(const std::array<double, 5>& distortion) {
  // Fine enough to meet each sign change of a cubic in r^2 that a real lens has; then bisection.
  constexpr double kStep = 1e-3;
  double high = kStep;
  while (high < kMaxRadius && RadialSlope(distortion, high) > 0.0)
    high += kStep;
  if (high >= kMaxRadius) return kMaxRadius;
  double low = high - kStep;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (RadialSlope(distortion, middle) > 0.0 ? low : high) = middle;
  }
  return low;
}

}  // namespace

PinholeCamera::PinholeCamera(const CameraIntrinsics& intrinsics)
    : intrinsics_(intrinsics),
      has_distortion_(
          std::ranges::any_of(intrinsics.distortion, [](double k) { return k != 0.0; })),
      max_radius_(has_distortion_ ? FoldRadius(intrinsics.distortion) : kMaxRadius) {}

PinholeCamera::Distorted PinholeCamera::Distort(const Eigen::Vector2d& undistorted) const {
  const auto& [k1, k2, p1, p2, k3] = intrinsics_.distortion;
  const double x = undistorted.x();
  const double y = undistorted.y();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double radial_slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));  // d radial / d r2 * 2
  Distorted distorted;
  distorted.point << x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
      y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
  distorted.J(0, 0) = radial + x * x * radial_slope + 2.0 * p1 * y + 6.0 * p2 * x;
  distorted.J(0, 1) = x * y * radial_slope + 2.0 * p1 * x + 2.0 * p2 * y;
  distorted.J(1, 0) = distorted.J(0, 1);
  distorted.J(1, 1) = radial + y * y * radial_slope + 6.0 * p1 * y + 2.0 * p2 * x;
  return distorted;
}

std::optional<PinholeCamera::Projection> PinholeCamera::ProjectWithJacobian(
    const Eigen::Vector3d& p_CP) const {
  if (!(p_CP.z() > kMinDepth) || !p_CP.allFinite()) return std::nullopt;
  const double inverse_depth = 1.0 / p_CP.z();
  const Eigen::Vector2d undistorted = p_CP.head<2>() * inverse_depth;
  if (!(undistorted.norm() < max_radius_)) return std::nullopt;
  Eigen::Matrix<double, 2, 3> J;
  J << inverse_depth, 0.0, -undistorted.x() * inverse_depth,  //
      0.0, inverse_depth, -undistorted.y() * inverse_depth;
  Distorted distorted{.point = undistorted, .J = Eigen::Matrix2d::Identity()};
  if (has_distortion_) distorted = Distort(undistorted);
  const Eigen::Vector2d focal(intrinsics_.fx, intrinsics_.fy);
  return Projection{.pixel = focal.cwiseProduct(distorted.point) +
                             Eigen::Vector2d(intrinsics_.cx, intrinsics_.cy),
                    .J_p_CP = focal.asDiagonal() * distorted.J * J};
}

std::optional<Eigen::Vector2d> PinholeCamera::Project(const Eigen::Vector3d& p_CP) const {
  const std::optional<Projection> projection = ProjectWithJacobian(p_CP);
  if (!projection) return std::nullopt;
  return projection->pixel;
}

std::optional<Eigen::Vector2d> PinholeCamera::Unproject(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d target((pixel.x() - intrinsics_.cx) / intrinsics_.fx,
                               (pixel.y() - intrinsics_.cy) / intrinsics_.fy);
  if (!target.allFinite()) return std::nullopt;
  if (!has_distortion_) return target;

  // Newton converges quadratically: 20 steps are far more than any pixel in front of the fold
  // needs.
  constexpr int kMaxSteps = 20;
  constexpr double kTolerance = 1e-7;  // of a step: the error after it is about its square
  Eigen::Vector2d undistorted = target;
  // A start behind the fold would converge to the wrong branch, or not at all.
  if (undistorted.norm() >= max_radius_) undistorted *= 0.5 * max_radius_ / undistorted.norm();
  for (int step = 0; step < kMaxSteps; ++step) {
    const Distorted distorted = Distort(undistorted);
    const Eigen::Vector2d correction = distorted.J.inverse() * (target - distorted.point);
    undistorted += correction;
    if (!undistorted.allFinite()) return std::nullopt;
    if (correction.squaredNorm() < kTolerance * kTolerance) {
      if (undistorted.norm() >= max_radius_) return std::nullopt;
      return undistorted;
    }
  }
  return std::nullopt;
}

}  // namespace relocd
