#include "scene_coordinates/head_trainer.h"

#include <algorithm>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene_coordinates/map_file.h"
#include "scene_coordinates/test_map.h"

namespace relocd {
namespace {

constexpr int kDimension = 16;
constexpr std::size_t kPoints = 60;
constexpr std::size_t kCameras = 8;

/// Points in front of a row of cameras, each with a feature of its own: what training must learn by
/// heart.
struct PointScene {
  explicit PointScene(bool with_depth) {
    const std::vector<float> places = RandomFloats(kPoints * 3, 2.0, 1);
    const std::vector<float> features = RandomFloats(kPoints * kDimension, 1.0, 2);
    set.dimension = kDimension;
    set.focal_px = 500.0;
    set.typical_depth_m = 10.0;
    for (std::size_t camera = 0; camera < kCameras; ++camera) {
      set.X_WCs.emplace_back(Eigen::Quaterniond::Identity(),
                             Eigen::Vector3d(static_cast<double>(camera) - 4.0, 0.0, 0.0));
    }
    for (std::size_t point = 0; point < kPoints; ++point) {
      const float* place = places.data() + 3 * point;
      p_WPs.emplace_back(place[0], place[1], 12.0F + place[2]);
      for (std::size_t camera = 0; camera < kCameras; ++camera) {
        const Eigen::Vector3f p_CP = p_WPs.back() - set.X_WCs[camera].translation().cast<float>();
        set.targets.push_back({p_CP.x() / p_CP.z(),
                               p_CP.y() / p_CP.z(),
                               with_depth ? 1.0F / p_CP.z() : 0.0F,
                               static_cast<std::uint32_t>(camera)});
        for (std::size_t i = 0; i < kDimension; ++i) {
          set.features.push_back(ToBfloat16(features[point * kDimension + i]));
        }
      }
    }
  }

  /// Median distance of the head's points from the true ones.
  [[nodiscard]] double MedianError(const Head& head) const {
    std::vector<float> features;
    for (std::size_t point = 0; point < kPoints; ++point) {
      for (std::size_t i = 0; i < kDimension; ++i) {
        features.push_back(ToFloat(set.features[point * kCameras * kDimension + i]));
      }
    }
    const auto points = EvaluateHead(head, features);
    std::vector<double> errors;
    for (std::size_t point = 0; point < kPoints; ++point) {
      errors.push_back((points[point].p_WP - p_WPs[point]).norm());
    }
    std::nth_element(errors.begin(), errors.begin() + kPoints / 2, errors.end());
    return errors[kPoints / 2];
  }

  TrainingSet set;
  std::vector<Eigen::Vector3f> p_WPs;
};

HeadTrainerConfig TestConfig() {
  HeadTrainerConfig config;
  config.shape = {.inputs = kDimension, .width = 64, .blocks = 1};
  config.iterations = 800;
  config.batch = 256;
  config.precision = Precision::kFloat32;
  config.seed = 3;
  return config;
}

class HeadTrainerSceneTest : public testing::TestWithParam<bool> {};

TEST_P(HeadTrainerSceneTest, FindsThePointsOfASmallScene) {
  const PointScene scene(GetParam());
  std::vector<double> losses;
  const auto head =
      TrainHead(scene.set, TestConfig(), {.progress = [&](const TrainingProgress& progress) {
                  losses.push_back(progress.loss);
                }});
  ASSERT_TRUE(head) << head.error().message;
  EXPECT_EQ(losses.size(), 16U);
  EXPECT_LT(losses.back(), 0.1 * losses.front());
  EXPECT_LT(scene.MedianError(*head), 0.3);
}

INSTANTIATE_TEST_SUITE_P(Depth, HeadTrainerSceneTest, testing::Bool(), [](const auto& instance) {
  return instance.param ? "Known" : "FromParallax";
});

std::vector<float> WeightsAfter(std::uint64_t seed, int threads, Precision precision) {
  const PointScene scene(true);
  HeadTrainerConfig config = TestConfig();
  config.iterations = 30;
  config.seed = seed;
  config.threads = threads;
  config.precision = precision;
  const auto head = TrainHead(scene.set, config, {});
  EXPECT_TRUE(head);
  return head->layers[1].weights;
}

TEST(HeadTrainerTest, TheSeedDecidesTheResultToTheBit) {
  EXPECT_EQ(WeightsAfter(5, 1, Precision::kFastest), WeightsAfter(5, 1, Precision::kFastest));
  EXPECT_NE(WeightsAfter(5, 1, Precision::kFastest), WeightsAfter(6, 1, Precision::kFastest));
}

TEST(HeadTrainerTest, TheNumberOfThreadsDoesNotChangeTheResult) {
  EXPECT_EQ(WeightsAfter(5, 1, Precision::kFloat32), WeightsAfter(5, 2, Precision::kFloat32));
  EXPECT_EQ(WeightsAfter(5, 1, Precision::kFastest), WeightsAfter(5, 3, Precision::kFastest));
}

TEST(HeadTrainerTest, GoesOnFromAStateToTheSameBits) {
  const PointScene scene(true);
  HeadTrainerConfig config = TestConfig();
  config.iterations = 40;
  config.precision = Precision::kFastest;
  std::vector<TrainerState> states;
  const auto whole =
      TrainHead(scene.set,
                config,
                {.state = [&](const TrainerState& state, const Head&) { states.push_back(state); },
                 .state_every = 13});
  ASSERT_TRUE(whole);
  ASSERT_EQ(states.size(), 3U);
  for (const TrainerState& state : states) {
    const auto resumed = TrainHead(scene.set, config, {.resume = &state});
    ASSERT_TRUE(resumed) << resumed.error().message;
    for (std::size_t layer = 0; layer < whole->layers.size(); ++layer) {
      EXPECT_EQ(resumed->layers[layer].weights, whole->layers[layer].weights) << state.iteration;
      EXPECT_EQ(resumed->layers[layer].bias, whole->layers[layer].bias) << state.iteration;
    }
  }
}

TEST(HeadTrainerTest, ShowsTheHeadAsItIs) {
  const PointScene scene(true);
  std::vector<double> errors;
  const auto head =
      TrainHead(scene.set,
                TestConfig(),
                {.state = [&](const TrainerState&,
                              const Head& now) { errors.push_back(scene.MedianError(now)); },
                 .state_every = 200});
  ASSERT_TRUE(head);
  ASSERT_EQ(errors.size(), 3U);
  EXPECT_LT(errors.back(), 0.5 * errors.front());
}

TEST(HeadTrainerTest, RefusesAStateOfAnotherTraining) {
  const PointScene scene(true);
  TrainerState state{.iteration = 900, .parameters = {1.0F}, .momentum = {}, .variance = {}};
  const auto head = TrainHead(scene.set, TestConfig(), {.resume = &state});
  ASSERT_FALSE(head);
  EXPECT_THAT(head.error().message,
              testing::HasSubstr("is at iteration 900 of 800 with 1 parameters, must be before"));
}

TEST(HeadTrainerTest, RefusesASetThatIsSmallerThanABatch) {
  const PointScene scene(true);
  HeadTrainerConfig config = TestConfig();
  config.batch = 4096;
  const auto head = TrainHead(scene.set, config, {});
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().message, "there are 480 training cells, must be at least a batch of 4096");
}

TEST(HeadTrainerTest, RefusesAConfigurationOutOfRange) {
  const PointScene scene(true);
  HeadTrainerConfig config = TestConfig();
  config.learning_rate = -1.0;
  const auto head = TrainHead(scene.set, config, {});
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().message, "training.learning_rate is -1, must be in [1e-08, 1]");
  config = TestConfig();
  config.batch = 255;
  EXPECT_EQ(TrainHead(scene.set, config, {}).error().message,
            "training.batch is 255, must be a multiple of 4");
}

}  // namespace
}  // namespace relocd
