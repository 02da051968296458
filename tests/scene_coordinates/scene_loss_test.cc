#include "scene_coordinates/scene_loss.h"

#include <array>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/random.h"

namespace relocd {
namespace {

using Output = std::array<float, kHeadOutputs>;

SceneLossConfig TestConfig(RobustShape shape = RobustShape::kTanh) {
  SceneLossConfig config;
  config.shape = shape;
  config.focal_px = 500.0F;
  config.tolerance_px = 40.0F;
  config.depth_baseline_m = 1.0F;
  config.depth_weight = 1.0F;
  config.typical_depth_m = 10.0F;
  config.confident_px = 3.0F;
  config.scale_m = 20.0F;
  return config;
}

/// A camera at the origin that looks along W's z: then p_C = 20 m * output / w.
const LossCamera kCamera{Eigen::Matrix3f::Identity(), Eigen::Vector3f::Zero()};

/// The derivatives of x, y, z and w by central differences.
void ExpectGradientAgreesWithDifferences(const SceneLossConfig& config,
                                         const TrainingTarget& target,
                                         const Output& output) {
  const auto loss_at = [&](const Output& at) {
    return EvaluateSceneLoss(config, kCamera, target, at).loss;
  };
  const SceneLoss loss = EvaluateSceneLoss(config, kCamera, target, output);
  double scale = 1.0;
  for (std::size_t i = 0; i < 4; ++i)
    scale = std::max(scale, std::abs(double{loss.gradient[i]}));
  for (std::size_t i = 0; i < 4; ++i) {
    constexpr float kStep = 2e-4F;
    Output up = output;
    Output down = output;
    up[i] += kStep;
    down[i] -= kStep;
    const double difference = (loss_at(up) - loss_at(down)) / (2.0 * kStep);
    EXPECT_NEAR(loss.gradient[i], difference, 0.03 * scale) << "output " << i;
  }
}

TEST(SceneLossTest, IsZeroForTheRightPoint) {
  const TrainingTarget target{.x = 0.2F, .y = -0.1F, .inverse_depth = 0.1F, .image = 0};
  const float homogeneous = HomogeneousScale(0.0F);
  const Output output = {2.0F / 20.0F * homogeneous,
                         -1.0F / 20.0F * homogeneous,
                         10.0F / 20.0F * homogeneous,
                         0.0F,
                         0.0F};
  const SceneLoss loss = EvaluateSceneLoss(TestConfig(), kCamera, target, output);
  EXPECT_TRUE(loss.valid);
  EXPECT_NEAR(loss.loss, 0.0F, 1e-3F);
  EXPECT_LT(loss.gradient[4], 0.0F);  // be more confident
}

TEST(SceneLossTest, GradientAgreesWithDifferences) {
  TestRandom random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const auto uniform = [&](double low, double high) {
      return static_cast<float>(random.Uniform(low, high));
    };
    const TrainingTarget target{.x = uniform(-0.5, 0.5),
                                .y = uniform(-0.3, 0.3),
                                .inverse_depth = trial % 2 == 0 ? 0.0F : uniform(0.03, 0.2),
                                .image = 0};
    // Within some tens of pixels, where the loss is smooth but for its kinks.
    const float depth = uniform(6.0, 30.0);
    const float raw = uniform(-1.0, 1.0);
    const float factor = HomogeneousScale(raw) / 20.0F;
    const Output output = {(target.x + uniform(0.01, 0.05)) * depth * factor,
                           (target.y + uniform(0.01, 0.05)) * depth * factor,
                           depth * factor,
                           raw,
                           0.0F};
    const SceneLossConfig config =
        TestConfig(trial % 4 < 2 ? RobustShape::kTanh : RobustShape::kLogarithm);
    ASSERT_TRUE(EvaluateSceneLoss(config, kCamera, target, output).valid);
    ExpectGradientAgreesWithDifferences(config, target, output);
  }
}

TEST(SceneLossTest, PointsBehindTheCameraArePulledInFrontOfIt) {
  const TrainingTarget target{.x = 0.1F, .y = 0.1F, .inverse_depth = 0.0F, .image = 0};
  const Output output = {0.3F, 0.2F, -0.5F, 0.1F, 0.0F};
  const SceneLoss loss = EvaluateSceneLoss(TestConfig(), kCamera, target, output);
  EXPECT_FALSE(loss.valid);
  EXPECT_LT(loss.gradient[2], 0.0F);
  EXPECT_GT(loss.gradient[4], 0.0F);  // be less confident
  ExpectGradientAgreesWithDifferences(TestConfig(), target, output);
}

TEST(SceneLossTest, LargeErrorsHardlyPullOnceTheToleranceIsSmall) {
  SceneLossConfig config = TestConfig();
  config.tolerance_px = 1.0F;
  const TrainingTarget target{.x = 0.0F, .y = 0.0F, .inverse_depth = 0.0F, .image = 0};
  const Output output = {0.1F, 0.1F, 0.5F, 0.0F, 0.0F};
  const SceneLoss loss = EvaluateSceneLoss(config, kCamera, target, output);
  EXPECT_TRUE(loss.valid);
  EXPECT_NEAR(loss.loss, 1.0F, 1e-3F);
  EXPECT_NEAR(loss.gradient[0], 0.0F, 1e-3F);
  config.shape = RobustShape::kLogarithm;
  const SceneLoss pulled = EvaluateSceneLoss(config, kCamera, target, output);
  EXPECT_GT(pulled.loss, 3.0F);
  EXPECT_GT(pulled.gradient[0], 3.0F) << "until then they do";
}

TEST(SceneLossTest, TheCameraIsPlacedRelativeToTheCentre) {
  const Pose3 X_WC(Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3), {1000.0, 2000.0, 5.0});
  const Eigen::Vector3d centre_W(990.0, 2010.0, 0.0);
  const Eigen::Vector3d p_WP(1003.0, 1995.0, 8.0);
  const LossCamera camera = MakeLossCamera(X_WC, centre_W);
  const Eigen::Vector3f p_CP = camera.R_CW * (p_WP - centre_W).cast<float>() + camera.p_CCentre;
  EXPECT_LT((p_CP.cast<double>() - X_WC.Inverse() * p_WP).norm(), 1e-4);
}

}  // namespace
}  // namespace relocd
