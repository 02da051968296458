#include "relocalization/camera_pose_estimator.h"

#include <chrono>
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/covariance.h"
#include "relocalization/test_scene.h"
#include "support/eigen_matchers.h"

namespace relocd {
namespace {

using ::testing::HasSubstr;

CameraPoseResult Estimate(const Scene& scene, std::uint64_t seed = 1) {
  return EstimateCameraPose(scene.correspondences, scene.camera(), {}, std::nullopt, seed);
}

Vector6d ErrorOf(const CameraPoseResult& result, const Scene& scene) {
  return (result.X_WC.Inverse() * scene.X_WC).Log();
}

TEST(CameraPoseEstimatorTest, IsExactWithoutNoise) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Scene scene = MakeScene({.outlier_share = 0.3, .pixel_sigma_px = 0.0}, seed);
    const CameraPoseResult result = Estimate(scene);
    ASSERT_EQ(result.status, CameraPoseStatus::kOk);
    EXPECT_LT(ErrorOf(result, scene).head<3>().norm(), 1e-4);
    EXPECT_LT(ErrorOf(result, scene).tail<3>().norm(), 1e-5);
  }
}

/// Share of outliers, in percent.
class OutlierShareTest : public testing::TestWithParam<int> {};

TEST_P(OutlierShareTest, FindsThePoseAndTellsInliersFromOutliers) {
  const double share = GetParam() / 100.0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    const Scene scene = MakeScene({.outlier_share = share}, seed);
    const CameraPoseResult result = Estimate(scene);
    ASSERT_EQ(result.status, CameraPoseStatus::kOk) << "seed " << seed;
    EXPECT_LT(ErrorOf(result, scene).head<3>().norm(), 0.15) << "seed " << seed;
    EXPECT_LT(ErrorOf(result, scene).tail<3>().norm(), 0.01) << "seed " << seed;

    // 7.5 sigma hold all inliers, and some outliers meet their pixel by chance: a disc of 7.5 px in
    // an image of 640 x 480 is 0.06 %.
    int inliers = 0;
    for (const bool is_inlier : scene.is_inlier)
      inliers += is_inlier ? 1 : 0;
    EXPECT_GE(result.inliers, inliers) << "seed " << seed;
    EXPECT_LE(result.inliers, inliers + 10) << "seed " << seed;
    EXPECT_NEAR(result.reprojection_rms_px, std::sqrt(2.0), 0.3);
    EXPECT_NEAR(result.confidence, 1.0 - share, 0.06);
  }
}

INSTANTIATE_TEST_SUITE_P(Shares,
                         OutlierShareTest,
                         testing::Values(0, 20, 40, 60, 80),
                         [](const auto& instance) {
                           return "Percent" + std::to_string(instance.param);
                         });

/// Pixel noise, in tenths of a pixel.
class CovarianceTest : public testing::TestWithParam<int> {};

TEST_P(CovarianceTest, IsThatOfTheErrorOverManyScenes) {
  constexpr int kScenes = 200;
  CameraPoseOptions options;
  options.hypotheses = 16;  // enough here, and four times as fast
  double nees = 0.0;
  int within_95 = 0;
  for (unsigned seed = 0; seed < kScenes; ++seed) {
    const Scene scene = MakeScene(
        {.correspondences = 600, .outlier_share = 0.4, .pixel_sigma_px = GetParam() / 10.0}, seed);
    const CameraPoseResult result =
        EstimateCameraPose(scene.correspondences, scene.camera(), options, std::nullopt, 1);
    ASSERT_EQ(result.status, CameraPoseStatus::kOk);
    ASSERT_TRUE(IsCovariance(result.covariance));
    const double squared = SquaredMahalanobis(ErrorOf(result, scene), result.covariance);
    nees += squared / kScenes;
    within_95 += squared < kChiSquared95Dof6 ? 1 : 0;
  }
  // The mean of 200 draws of a chi-squared of 6 degrees of freedom has a sigma of 0.24.
  EXPECT_GT(nees, 5.2);
  EXPECT_LT(nees, 6.8);
  EXPECT_GT(within_95, 0.91 * kScenes);
  EXPECT_LT(within_95, 0.98 * kScenes);
}

INSTANTIATE_TEST_SUITE_P(Noise,
                         CovarianceTest,
                         testing::Values(5, 10, 20, 40),
                         [](const auto& instance) {
                           return "TenthsOfAPixel" + std::to_string(instance.param);
                         });

TEST(CameraPoseEstimatorTest, IsAsPreciseFarFromTheOriginOfTheWorld) {
  // UTM coordinates: a float would resolve half a metre there.
  const Scene near = MakeScene({}, 3);
  const Scene far = MakeScene({.p_WScene = {447000.0, 5411000.0, 300.0}}, 3);
  const CameraPoseResult near_result = Estimate(near);
  const CameraPoseResult far_result = Estimate(far);
  ASSERT_EQ(far_result.status, CameraPoseStatus::kOk);
  EXPECT_THAT(ErrorOf(far_result, far), IsNear(ErrorOf(near_result, near), 1e-4));
}

TEST(CameraPoseEstimatorTest, GivesTheSameBitsForTheSameSeed) {
  const Scene scene = MakeScene({.outlier_share = 0.6}, 5);
  const CameraPoseResult first = Estimate(scene, 7);
  const CameraPoseResult second = Estimate(scene, 7);
  EXPECT_EQ(first.X_WC.translation(), second.X_WC.translation());
  EXPECT_EQ(first.X_WC.rotation().coeffs(), second.X_WC.rotation().coeffs());
  EXPECT_EQ(first.covariance, second.covariance);
  EXPECT_EQ(first.confidence, second.confidence);
}

TEST(CameraPoseEstimatorTest, FindsTheSamePoseFromAnotherSeed) {
  const Scene scene = MakeScene({.outlier_share = 0.6}, 5);
  EXPECT_LT((Estimate(scene, 7).X_WC.translation() - Estimate(scene, 8).X_WC.translation()).norm(),
            1e-4);
}

TEST(CameraPoseEstimatorTest, FindsNoPoseInGarbage) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    const Scene scene = MakeScene({.outlier_share = 1.0}, seed);
    EXPECT_NE(Estimate(scene, seed).status, CameraPoseStatus::kOk) << "seed " << seed;
  }
}

TEST(CameraPoseEstimatorTest, NeedsFourCorrespondences) {
  for (std::size_t count = 0; count < 4; ++count) {
    const CameraPoseResult result = Estimate(MakeScene({.correspondences = count}, 1));
    EXPECT_EQ(result.status, CameraPoseStatus::kNoHypothesis) << count;
    EXPECT_EQ(result.correspondences, static_cast<int>(count));
  }
}

/// How many of some scenes, nine tenths of which are wrong, are seen through.
int FoundAmongManyOutliers(bool knows_inliers) {
  CameraPoseOptions options;
  options.calibration.min_confidence = 0.05;
  int found = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Scene scene = MakeScene({.outlier_share = 0.9}, seed);
    for (std::size_t i = 0; knows_inliers && i < scene.correspondences.size(); ++i) {
      // Half of the wrong ones believe in themselves too.
      scene.correspondences[i].confidence = scene.is_inlier[i] || i % 2 == 0 ? 0.9F : 0.1F;
    }
    const auto result =
        EstimateCameraPose(scene.correspondences, scene.camera(), options, std::nullopt, seed);
    const Pose3 difference = scene.X_WC.Inverse() * result.X_WC;
    if (result.status == CameraPoseStatus::kOk && difference.translation().norm() < 0.5) ++found;
  }
  return found;
}

TEST(CameraPoseEstimatorTest, DrawsFromTheMoreConfidentHalf) {
  EXPECT_GE(FoundAmongManyOutliers(true), 18);
  EXPECT_LT(FoundAmongManyOutliers(false), 14);
}

TEST(CameraPoseEstimatorTest, CallsOnePointForAllPixelsDegenerate) {
  Scene scene = MakeScene({}, 2);
  for (Correspondence& c : scene.correspondences)
    c.p_WP = Eigen::Vector3d(1.0, 2.0, 3.0);
  EXPECT_EQ(Estimate(scene).status, CameraPoseStatus::kDegenerate);
}

/// All points on one line, seen by the camera as they are.
Scene SceneOfALine() {
  Scene scene = MakeScene({.pixel_sigma_px = 0.0}, 2);
  for (std::size_t i = 0; i < scene.correspondences.size(); ++i) {
    const double along = 0.01 * static_cast<double>(i) - 6.0;
    const Eigen::Vector3d p_CP(along, 0.5 * along, 20.0 + along);
    scene.correspondences[i] = {.pixel = scene.camera().Project(p_CP).value(),
                                .p_WP = scene.X_WC * p_CP};
  }
  return scene;
}

TEST(CameraPoseEstimatorTest, CallsPointsOnALineDegenerate) {
  const Scene scene = SceneOfALine();
  EXPECT_EQ(Estimate(scene).status, CameraPoseStatus::kDegenerate);
}

TEST(CameraPoseEstimatorTest, CallsPointsOnALineDegenerateEvenWhenAPriorExplainsThem) {
  const Scene scene = SceneOfALine();
  EXPECT_EQ(EstimateCameraPose(scene.correspondences, scene.camera(), {}, scene.X_WC, 1).status,
            CameraPoseStatus::kDegenerate);
}

TEST(CameraPoseEstimatorTest, IgnoresCorrespondencesThatAreNotFinite) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Scene scene = MakeScene({}, 4);
  for (std::size_t i = 0; i < scene.correspondences.size(); ++i) {
    Correspondence& c = scene.correspondences[i];
    if (i % 4 == 0) c.p_WP[static_cast<Eigen::Index>(i / 4 % 3)] = kNan;
    if (i % 4 == 1) c.pixel[static_cast<Eigen::Index>(i / 4 % 2)] = -kInfinity;
    if (i % 4 == 2) c.p_WP *= 1e300;
  }
  const CameraPoseResult result = Estimate(scene);
  ASSERT_EQ(result.status, CameraPoseStatus::kOk);
  EXPECT_EQ(result.correspondences, 1200);
  EXPECT_EQ(result.inliers, 300);
  EXPECT_NEAR(result.confidence, 0.25, 0.01);
  EXPECT_LT(SquaredMahalanobis(ErrorOf(result, scene), result.covariance), 30.0);
}

TEST(CameraPoseEstimatorTest, FindsNothingWhenNothingIsFinite) {
  Scene scene = MakeScene({}, 4);
  for (Correspondence& c : scene.correspondences)
    c.pixel.setConstant(NAN);
  EXPECT_EQ(Estimate(scene).status, CameraPoseStatus::kNoHypothesis);
}

TEST(CameraPoseEstimatorTest, DoesNotCountPointsBehindTheCamera) {
  // A point mirrored at the camera has the same pixel in a model that forgets the sign of depth.
  Scene scene = MakeScene({}, 6);
  for (std::size_t i = 0; i < scene.correspondences.size(); i += 2) {
    Correspondence& c = scene.correspondences[i];
    c.p_WP = 2.0 * scene.X_WC.translation() - c.p_WP;
  }
  const CameraPoseResult result = Estimate(scene);
  ASSERT_EQ(result.status, CameraPoseStatus::kOk);
  EXPECT_LT(ErrorOf(result, scene).head<3>().norm(), 0.15);
  EXPECT_NEAR(result.inliers, 600, 6);
  EXPECT_NEAR(result.confidence, 0.5, 0.01);
}

TEST(CameraPoseEstimatorTest, TakesAPriorWhereSamplingFindsNothing) {
  const Scene scene = MakeScene({.outlier_share = 0.8}, 8);
  CameraPoseOptions options;
  options.max_tries = 1;
  const auto estimate = [&](const std::optional<Pose3>& prior) {
    return EstimateCameraPose(scene.correspondences, scene.camera(), options, prior, 1);
  };
  EXPECT_NE(estimate(std::nullopt).status, CameraPoseStatus::kOk);
  Vector6d offset;
  offset << 0.1, -0.1, 0.1, 0.01, 0.01, -0.01;
  const CameraPoseResult result = estimate(scene.X_WC * Pose3::Exp(offset));
  ASSERT_EQ(result.status, CameraPoseStatus::kOk);
  EXPECT_LT(ErrorOf(result, scene).head<3>().norm(), 0.15);
}

TEST(CameraPoseEstimatorTest, IsNotMovedByAWrongPrior) {
  const Scene scene = MakeScene({.outlier_share = 0.5}, 9);
  const Pose3 wrong(Eigen::Quaterniond::UnitRandom(), Eigen::Vector3d(100.0, -50.0, NAN));
  for (const Pose3& prior : {Pose3(), wrong}) {
    const CameraPoseResult result =
        EstimateCameraPose(scene.correspondences, scene.camera(), {}, prior, 1);
    ASSERT_EQ(result.status, CameraPoseStatus::kOk);
    EXPECT_LT(ErrorOf(result, scene).head<3>().norm(), 0.15);
  }
}

TEST(CameraPoseEstimatorTest, AppliesTheCalibrationOfTheMap) {
  const Scene scene = MakeScene({.outlier_share = 0.5}, 10);
  CameraPoseOptions options;
  options.calibration = {
      .covariance_scale = 25.0, .translation_floor_sigma_m = 0.2, .rotation_floor_sigma_rad = 0.01};
  const Matrix6d plain = Estimate(scene).covariance;
  const CameraPoseResult result =
      EstimateCameraPose(scene.correspondences, scene.camera(), options, std::nullopt, 1);
  Matrix6d expected = 25.0 * plain;
  expected.diagonal().head<3>().array() += 0.04;
  expected.diagonal().tail<3>().array() += 0.0001;
  EXPECT_THAT(result.covariance, IsNear(expected, 1e-6));

  options.calibration.min_confidence = 0.9;
  EXPECT_EQ(
      EstimateCameraPose(scene.correspondences, scene.camera(), options, std::nullopt, 1).status,
      CameraPoseStatus::kLowConfidence);
}

TEST(CameraPoseEstimatorTest, WidensTheCovarianceWhereTwoPlacesLookAlike) {
  // Every second point is where it is for a camera 3 m to the side: two poses, equally good.
  Scene scene = MakeScene({}, 11);
  const Eigen::Vector3d offset(3.0, 0.0, 0.0);
  for (std::size_t i = 0; i < scene.correspondences.size(); i += 2) {
    scene.correspondences[i].p_WP += offset;
  }
  const CameraPoseResult result = Estimate(scene);
  ASSERT_EQ(result.status, CameraPoseStatus::kOk);
  const Eigen::Vector3d direction_C = scene.X_WC.rotation().inverse() * offset.normalized();
  const double sigma =
      std::sqrt(direction_C.dot(result.covariance.topLeftCorner<3, 3>() * direction_C));
  EXPECT_GT(sigma, 1.0);
  EXPECT_LT(sigma, 3.0);
}

TEST(CameraPoseOptionsTest, DefaultsAreValid) {
  EXPECT_TRUE(CameraPoseOptions{}.Validate().has_value());
}

TEST(CameraPoseOptionsTest, NamesTheFieldThatIsOutOfRange) {
  CameraPoseOptions options;
  options.hypotheses = 0;
  EXPECT_THAT(options.Validate().error().message,
              HasSubstr("hypotheses is 0, must be in [1, 10000]"));
  options = {};
  options.inlier_threshold_mrad = NAN;
  EXPECT_THAT(options.Validate().error().message,
              HasSubstr("inlier_threshold_mrad is nan, must be in [0.1, 1000]"));
  options = {};
  options.max_sigma_t_m = 0.0;
  EXPECT_THAT(options.Validate().error().message, HasSubstr("max_sigma_t_m is 0, must be > 0"));
}

}  // namespace
}  // namespace relocd
