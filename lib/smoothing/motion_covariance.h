#pragma once

#include <Eigen/Core>

#include "geometry/pose2.h"

namespace relocd {

/// The covariance of X_AC = X_AB * X_BC, all 3x3 of right perturbations (x, y, yaw), of
/// independent errors: the perturbation of X_AB, seen from C, plus that of X_BC.
///
/// Sola et al. (2018), section IV: X_AB * Exp(d) * X_BC = X_AB * X_BC * Exp(Adjoint(X_CB) * d).
inline Eigen::Matrix3d ComposeCovariance(const Eigen::Matrix3d& covariance_AB,
                                         const Pose2& X_BC,
                                         const Eigen::Matrix3d& covariance_BC) {
  const Eigen::Matrix3d adjoint_CB = X_BC.Inverse().Adjoint();
  const Eigen::Matrix3d sum = adjoint_CB * covariance_AB * adjoint_CB.transpose() + covariance_BC;
  return 0.5 * (sum + sum.transpose());
}

}  // namespace relocd
