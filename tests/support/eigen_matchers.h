#pragma once

#include <Eigen/Core>
#include <gmock/gmock.h>

namespace relocd {

/// Matches a vector or matrix of the same shape whose every coefficient is within `tolerance`.
MATCHER_P2(IsNear, expected, tolerance, "") {
  if (arg.rows() != expected.rows() || arg.cols() != expected.cols()) {
    *result_listener << "which is " << arg.rows() << "x" << arg.cols();
    return false;
  }
  const double worst = (arg - expected).cwiseAbs().maxCoeff();
  *result_listener << "which is off by up to " << worst;
  return worst <= tolerance;  // false for NaN
}

}  // namespace relocd
