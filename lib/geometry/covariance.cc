#include "geometry/covariance.h"

#include <Eigen/Cholesky>

namespace relocd {

bool IsCovariance(const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  return covariance.rows() == covariance.cols() && IsSymmetricToRounding(covariance) &&
         IsPositiveDefinite(Eigen::LLT<Eigen::MatrixXd>(covariance));
}

double SquaredMahalanobis(const Eigen::Ref<const Eigen::VectorXd>& error,
                          const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  return error.dot(covariance.llt().solve(error));
}

}  // namespace relocd
