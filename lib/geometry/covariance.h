#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace relocd {

/// Whether a square matrix is finite and symmetric to rounding. Squares nothing: numbers of 1e308
/// would hide all others.
template <typename Matrix>
bool IsSymmetricToRounding(const Matrix& matrix) {
  constexpr double kAsymmetry = 1e-6;
  return matrix.allFinite() && (matrix - matrix.transpose()).cwiseAbs().maxCoeff() <=
                                   kAsymmetry * matrix.cwiseAbs().maxCoeff();
}

/// Whether a matrix that was factored so is positive definite. Eigen takes what overflows for it.
template <typename Matrix>
bool IsPositiveDefinite(const Eigen::LLT<Matrix>& factor) {
  return factor.info() == Eigen::Success && factor.matrixLLT().allFinite();
}

/// Whether `covariance` (n x n) is finite, symmetric to rounding, and positive definite: what a
/// message, a file or a measurement must satisfy before its inverse is taken.
bool IsCovariance(const Eigen::Ref<const Eigen::MatrixXd>& covariance);

/// The same for a size known beforehand, without taking memory.
template <int Size>
requires(Size !=
         Eigen::Dynamic) bool IsCovariance(const Eigen::Matrix<double, Size, Size>& covariance) {
  return IsSymmetricToRounding(covariance) && IsPositiveDefinite(covariance.llt());
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
