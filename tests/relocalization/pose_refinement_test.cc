#include "relocalization/pose_refinement.h"

#include <cmath>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "relocalization/soft_inlier_score.h"
#include "relocalization/test_scene.h"
#include "support/eigen_matchers.h"

namespace relocd {
namespace {

constexpr double kThresholdPx = 6.0;

CameraFromWorld InPackedFrame(const Pose3& X_WC, const PackedCorrespondences& packed) {
  const Eigen::Matrix3d R_CW = X_WC.R().transpose();
  return {.R_CW = R_CW, .p_CW = R_CW * (packed.p_WM() - X_WC.translation())};
}

/// The undistorted camera that packed correspondences are seen with.
PinholeCamera PackedCamera(const Scene& scene) {
  CameraIntrinsics intrinsics = scene.intrinsics;
  intrinsics.cx = 0.0;
  intrinsics.cy = 0.0;
  intrinsics.distortion = {};
  return PinholeCamera(intrinsics);
}

TEST(PoseRefinementTest, ComesBackFromADisturbance) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Scene scene = MakeScene({.outlier_share = 0.5, .pixel_sigma_px = 0.0}, seed);
    const PackedCorrespondences packed(scene.correspondences, scene.camera(), seed);
    Vector6d disturbance;
    disturbance << 0.1, -0.2, 0.15, 0.01, -0.01, 0.02;
    const CameraFromWorld start = InPackedFrame(scene.X_WC * Pose3::Exp(disturbance), packed);
    const RefinedPose refined = RefinePose(packed, packed.size(), start, {});
    const CameraFromWorld truth = InPackedFrame(scene.X_WC, packed);
    ASSERT_FALSE(refined.degenerate);
    EXPECT_THAT(refined.X_CM.R_CW, IsNear(truth.R_CW, 1e-5));
    EXPECT_THAT(refined.X_CM.p_CW, IsNear(truth.p_CW, 2e-4));
  }
}

TEST(PoseRefinementTest, CovarianceIsTheInverseHessianOfThePinholeModel) {
  const Scene scene = MakeScene({.outlier_share = 0.3, .pixel_sigma_px = 1.5}, 1);
  const PackedCorrespondences packed(scene.correspondences, scene.camera(), 1);
  const RefinedPose refined = RefinePose(
      packed,
      packed.size(),
      InPackedFrame(scene.X_WC, packed),
      {.steps = 12, .start_threshold_px = kThresholdPx, .end_threshold_px = kThresholdPx});
  const PinholeCamera camera = PackedCamera(scene);
  Matrix6d hessian = Matrix6d::Zero();
  for (std::size_t i = 0; i < packed.size(); ++i) {
    const Eigen::Vector3d p_CP = refined.X_CM * packed.p_MP(i);
    const auto projection = camera.ProjectWithJacobian(p_CP);
    if (!projection || p_CP.z() < kMinDepth) continue;
    Eigen::Matrix<double, 3, 6> J_p;
    J_p << Eigen::Matrix3d::Identity(), -Skew(p_CP);
    const Eigen::Matrix<double, 2, 6> J = projection->J_p_CP * J_p;
    const double ratio =
        (projection->pixel - packed.pixel(i)).squaredNorm() / (kThresholdPx * kThresholdPx);
    hessian += J.transpose() * J / ((1.0 + ratio) * (1.0 + ratio));
  }
  const Matrix6d product = refined.covariance * hessian;  // the residual variance times identity
  const double variance = product.trace() / 6.0;
  EXPECT_NEAR(variance, 1.5 * 1.5, 0.5);
  const Vector6d scale = hessian.diagonal().cwiseSqrt();
  const Matrix6d scaled = scale.asDiagonal() * product * scale.cwiseInverse().asDiagonal();
  EXPECT_THAT(scaled, IsNear(Matrix6d(variance * Matrix6d::Identity()), 1e-2 * variance));
}

TEST(PoseRefinementTest, CallsTooFewInliersDegenerate) {
  const Scene scene = MakeScene({.outlier_share = 1.0}, 1);
  const PackedCorrespondences packed(scene.correspondences, scene.camera(), 1);
  Vector6d away;
  away << 0.0, 0.0, 1e4, 0.0, 0.0, 0.0;
  const CameraFromWorld start = InPackedFrame(scene.X_WC * Pose3::Exp(away), packed);
  EXPECT_TRUE(RefinePose(packed, packed.size(), start, {}).degenerate);
}

TEST(SoftInlierScoreTest, IsTheSumOfItsFormula) {
  // 1203 is no multiple of the lanes.
  const Scene scene = MakeScene({.correspondences = 1203, .outlier_share = 0.5}, 2);
  const PackedCorrespondences packed(scene.correspondences, scene.camera(), 1);
  ASSERT_EQ(packed.size(), 1203U);
  const CameraFromWorld X_CM = InPackedFrame(scene.X_WC, packed);
  const PinholeCamera camera = PackedCamera(scene);
  double expected = 0.0;
  for (std::size_t i = 0; i < packed.size(); ++i) {
    const Eigen::Vector3d p_CP = X_CM * packed.p_MP(i);
    if (p_CP.z() < kMinDepth) continue;
    const auto pixel = camera.Project(p_CP);
    if (!pixel) continue;
    expected += 1.0 / (1.0 + std::pow((*pixel - packed.pixel(i)).norm() / kThresholdPx, 4.0));
  }
  EXPECT_NEAR(SoftInlierScore(packed, packed.size(), X_CM, kThresholdPx), expected, 1e-2);
  EXPECT_NEAR(SoftInlierScore(packed, 1'000'000, X_CM, kThresholdPx), expected, 1e-2);
}

TEST(PackedCorrespondencesTest, KeepsEachCorrespondenceInAnotherOrder) {
  const Scene scene = MakeScene({.correspondences = 50, .pixel_sigma_px = 0.0}, 3);
  const PackedCorrespondences packed(scene.correspondences, scene.camera(), 1);
  const CameraFromWorld X_CM = InPackedFrame(scene.X_WC, packed);
  int in_place = 0;
  for (std::size_t i = 0; i < packed.size(); ++i) {
    // Point and pixel are of one correspondence: the one leads to the other.
    EXPECT_THAT(Eigen::Vector3d((X_CM * packed.p_MP(i)).normalized()),
                IsNear(packed.Ray_C(i), 1e-6));
    const Eigen::Vector3d p_WP = packed.p_WM() + packed.p_MP(i);
    in_place += (p_WP - scene.correspondences[i].p_WP).norm() < 1e-3 ? 1 : 0;
  }
  EXPECT_LT(in_place, 10);
}

}  // namespace
}  // namespace relocd
