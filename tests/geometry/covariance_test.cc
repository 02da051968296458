#include "geometry/covariance.h"

#include <limits>

#include <gtest/gtest.h>

namespace relocd {
namespace {

TEST(CovarianceTest, RefusesWhatHasNoInverse) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  EXPECT_TRUE(IsCovariance(covariance));
  covariance(0, 0) = 0.0;
  EXPECT_FALSE(IsCovariance(covariance));
  covariance(0, 0) = -1.0;
  EXPECT_FALSE(IsCovariance(covariance));
  covariance(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(IsCovariance(covariance));
  covariance << 1.0, 0.5, 0.0, -0.5, 1.0, 0.0, 0.0, 0.0, 1.0;
  EXPECT_FALSE(IsCovariance(covariance)) << "not symmetric";
  EXPECT_FALSE(IsCovariance(Eigen::MatrixXd::Identity(2, 3)));
}

/// Finite numbers whose squares are not.
TEST(CovarianceTest, RefusesWhatOverflows) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  covariance(0, 2) = -1e308;
  EXPECT_FALSE(IsCovariance(covariance)) << "not symmetric";
  EXPECT_FALSE(IsCovariance(Eigen::MatrixXd(covariance))) << "not symmetric";
  covariance(2, 0) = -1e308;
  EXPECT_FALSE(IsCovariance(covariance)) << "not positive definite";
  covariance(0, 0) = 0.01;
  EXPECT_FALSE(IsCovariance(covariance)) << "not positive definite, and the root overflows";
  EXPECT_FALSE(IsCovariance(Eigen::MatrixXd(covariance)));
}

TEST(CovarianceTest, MahalanobisDistanceWeighsByTheInverse) {
  Eigen::Matrix2d covariance;
  covariance << 4.0, 0.0, 0.0, 0.25;
  EXPECT_NEAR(SquaredMahalanobis(Eigen::Vector2d(2.0, 0.5), covariance), 2.0, 1e-12);
}

}  // namespace
}  // namespace relocd
