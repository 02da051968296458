#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace relocd {

/// Whether `covariance` (n x n) is finite, symmetric to rounding, and positive definite: what a
/// message, a file or a measurement must satisfy before its inverse is taken.
bool IsCovariance(const Eigen::Ref<const Eigen::MatrixXd>& covariance);

/// The same for a size known beforehand, without taking memory.
template <int Size>
requires(Size !=
         Eigen::Dynamic) bool IsCovariance(const Eigen::Matrix<double, Size, Size>& covariance) {
  constexpr double kAsymmetry = 1e-6;
  if (!covariance.allFinite()) return false;
  if (!covariance.isApprox(covariance.transpose(), kAsymmetry)) return false;
  return covariance.llt().info() == Eigen::Success;
}

/// The squared Mahalanobis distance `error^T covariance^-1 error`. `covariance` must be positive
/// definite.
double SquaredMahalanobis(const Eigen::Ref<const Eigen::VectorXd>& error,
                          const Eigen::Ref<const Eigen::MatrixXd>& covariance);

/// The same for a size known beforehand, without taking memory.
template <int Size>
requires(Size != Eigen::Dynamic) double SquaredMahalanobis(
    const Eigen::Matrix<double, Size, 1>& error,
    const Eigen::Matrix<double, Size, Size>& covariance) {
  return error.dot(covariance.llt().solve(error));
}

/// Below these a standard normal error's squared Mahalanobis distance lies in 95 % of all draws.
inline constexpr double kChiSquared95Dof2 = 5.991464547107979;
inline constexpr double kChiSquared95Dof3 = 7.814727903251179;
inline constexpr double kChiSquared95Dof6 = 12.591587243743977;

}  // namespace relocd
