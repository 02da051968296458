#pragma once

#include <cmath>
#include <numbers>

namespace relocd {

/// Wraps an angle into [-pi, pi).
///
/// T is double, or an automatic-differentiation scalar that has its own `floor`; the derivative is
/// that of the identity.
template <typename T>
T WrapAngle(const T& angle_rad) {
  using std::floor;
  const auto pi = static_cast<T>(std::numbers::pi);
  return angle_rad - 2.0 * pi * floor((angle_rad + pi) / (2.0 * pi));
}

}  // namespace relocd
