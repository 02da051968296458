#include "geometry/covariance.h"

#include <Eigen/Cholesky>

namespace relocd {

bool IsCovariance(const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  constexpr double kAsymmetry = 1e-6;
  if (covariance.rows() != covariance.cols() || !covariance.allFinite()) return false;
  if (!covariance.isApprox(covariance.transpose(), kAsymmetry)) return false;
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  return factor.info() == Eigen::Success;
}

double SquaredMahalanobis(const Eigen::Ref<const Eigen::VectorXd>& error,
                          const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  return error.dot(covariance.llt().solve(error));
}

}  // namespace relocd
