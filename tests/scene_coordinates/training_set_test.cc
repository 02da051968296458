#include "scene_coordinates/training_set.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene_coordinates/head_trainer.h"
#include "scene_coordinates/map_file.h"
#include "scene_coordinates/scene_coordinate_predictor.h"
#include "scene_coordinates/wall_scene.h"

namespace relocd {
namespace {

using testing::HasSubstr;

TrainingSetConfig TestConfig() {
  TrainingSetConfig config;
  config.cells_per_view = 400;
  config.views_per_image = 2;
  return config;
}

FeatureWhitening Whitening(const std::vector<TrainingImage>& drive) {
  std::vector<GrayImage> images;
  for (const TrainingImage& image : drive) {
    images.push_back(image.image);
  }
  return FitWhiteningToImages(images, WallScene::Features(), 48).value();
}

Result<TrainingSet> Prepare(const std::vector<TrainingImage>& images,
                            const FeatureWhitening& whitening,
                            const TrainingSetConfig& config) {
  const PinholeCamera camera(WallScene::Intrinsics());
  return PrepareTraining(images, camera, WallScene::Features(), whitening, config, {});
}

TEST(TrainingSetTest, KnowsWhereEachCellLooksAlsoInChangedCopies) {
  const std::vector<TrainingImage> images = WallScene().Drive(6);
  const auto set = Prepare(images, Whitening(images), TestConfig());
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_EQ(set->features.size(), set->targets.size() * 48);
  EXPECT_GT(set->targets.size(), 6U * 400U);
  EXPECT_NEAR(set->typical_depth_m, 8.2, 0.5);
  int known = 0;
  int right = 0;
  for (const TrainingTarget& target : set->targets) {
    if (target.inverse_depth == 0.0F) continue;
    ++known;
    const double depth = WallScene::Depth(images[target.image].X_WC, {target.x, target.y});
    if (std::abs(depth * static_cast<double>(target.inverse_depth) - 1.0) < 0.1) ++right;
  }
  EXPECT_GT(known, static_cast<int>(set->targets.size()) / 3);
  EXPECT_GT(right, known * 8 / 10);
}

/// As a depth camera would see the wall, but for its left third.
MeasuredDepth DepthOfWall(const Pose3& X_WC) {
  const PinholeCamera camera(WallScene::Intrinsics());
  MeasuredDepth depth{.width = WallScene::kWidth, .height = WallScene::kHeight, .depth_mm = {}};
  for (int v = 0; v < WallScene::kHeight; ++v) {
    for (int u = 0; u < WallScene::kWidth; ++u) {
      const double depth_m = WallScene::Depth(X_WC, *camera.Unproject({u, v}));
      depth.depth_mm.push_back(
          u < WallScene::kWidth / 3 ? 0 : static_cast<std::uint16_t>(std::lround(1e3 * depth_m)));
    }
  }
  return depth;
}

TEST(TrainingSetTest, DepthImagesSayWhereCellsLook) {
  std::vector<TrainingImage> images = WallScene().Drive(4);
  for (TrainingImage& image : images)
    image.depth = DepthOfWall(image.X_WC);
  TrainingSetConfig config = TestConfig();
  config.measure_depth = false;
  const auto given = Prepare(images, Whitening(images), config);
  ASSERT_TRUE(given) << given.error().message;
  const double left = (WallScene::kWidth / 3.0 - WallScene::Intrinsics().cx) / 220.0;
  int known = 0;
  int right = 0;  // of the border
  for (const TrainingTarget& target : given->targets) {
    if (target.x > left + 0.05) ++right;
    if (target.inverse_depth == 0.0F) continue;
    ++known;
    EXPECT_GT(target.x, left - 0.05);
    const double depth_m = WallScene::Depth(images[target.image].X_WC, {target.x, target.y});
    EXPECT_NEAR(depth_m * static_cast<double>(target.inverse_depth), 1.0, 0.02);
  }
  EXPECT_GT(known, right * 8 / 10);

  config.measure_depth = true;  // what the depth camera does not know is looked for
  const auto found = Prepare(images, Whitening(images), config);
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_GT(std::count_if(found->targets.begin(),
                          found->targets.end(),
                          [&](const TrainingTarget& target) {
                            return target.inverse_depth != 0.0F && target.x < left - 0.05;
                          }),
            50);
}

TEST(TrainingSetTest, RefusesADepthImageOfAnotherSize) {
  std::vector<TrainingImage> images = WallScene().Drive(4);
  images[2].depth = {.width = 2, .height = 1, .depth_mm = {1000, 1000}};
  const auto set = Prepare(images, Whitening(images), TestConfig());
  ASSERT_FALSE(set);
  EXPECT_EQ(set.error().message, "depth of training image 2 is 2 x 1 pixels, must be 240 x 160");
}

TEST(TrainingSetTest, TheNumberOfThreadsDoesNotChangeTheSet) {
  const std::vector<TrainingImage> images = WallScene().Drive(4);
  const FeatureWhitening whitening = Whitening(images);
  TrainingSetConfig config = TestConfig();
  const auto one = Prepare(images, whitening, config);
  config.threads = 3;
  const auto three = Prepare(images, whitening, config);
  ASSERT_TRUE(one && three);
  ASSERT_EQ(one->features.size(), three->features.size());
  EXPECT_EQ(
      std::memcmp(
          one->features.data(), three->features.data(), one->features.size() * sizeof(Bfloat16)),
      0);
}

TEST(TrainingSetTest, RefusesAnImageOfAnotherSize) {
  std::vector<TrainingImage> images = WallScene().Drive(4);
  const FeatureWhitening whitening = Whitening(images);
  images[2].image = Texture(1).Image(64, 64);
  const auto prepared = Prepare(images, whitening, TestConfig());
  ASSERT_FALSE(prepared);
  EXPECT_THAT(prepared.error().message,
              HasSubstr("training image 2 is 64 x 64 pixels, must be 240 x 160"));
  const auto fitted =
      FitWhiteningToImages({images[0].image, images[2].image}, WallScene::Features(), 48);
  ASSERT_FALSE(fitted);
  EXPECT_THAT(fitted.error().message,
              HasSubstr("training image 1 is 64 x 64 pixels, must be 240 x 160"));
}

TEST(TrainingSetTest, RefusesTheWhiteningOfOtherFeatures) {
  const std::vector<TrainingImage> images = WallScene().Drive(4);
  FeatureWhitening whitening = Whitening(images);
  whitening.inputs = 17;
  const auto prepared = Prepare(images, whitening, TestConfig());
  ASSERT_FALSE(prepared);
  EXPECT_THAT(prepared.error().message, HasSubstr("whitening.inputs is 17, must be"));
}

/// The whole way: a map is made of a drive along the wall, and finds points in a view between.
TEST(SceneCoordinatePredictorTest, FindsThePointsOfAViewThatWasNotTrained) {
  const WallScene wall;
  const std::vector<TrainingImage> drive = wall.Drive(8);
  const FeatureWhitening whitening = Whitening(drive);
  const auto set = Prepare(drive, whitening, TestConfig());
  ASSERT_TRUE(set);
  HeadTrainerConfig trainer;
  trainer.shape = {.inputs = 48, .width = 64, .blocks = 1};
  trainer.iterations = 400;
  trainer.batch = 512;
  auto head = TrainHead(*set, trainer, {});
  ASSERT_TRUE(head) << head.error().message;
  SceneMap map;
  map.camera = WallScene::Intrinsics();
  map.features = WallScene::Features();
  map.cells_per_image = 200;
  map.whitening = whitening;
  map.regions.emplace_back().head = std::move(*head);

  const TrainingImage view = wall.View(Pose3(Eigen::Quaterniond::Identity(), {1.4, 0.05, 0.0}));
  auto predictor = SceneCoordinatePredictor::Create(map, 1);
  ASSERT_TRUE(predictor);
  ASSERT_TRUE((*predictor)->Extract(view.image));
  const auto predictions = (*predictor)->Predict(0);
  ASSERT_EQ(predictions.size(), 200U);
  const PinholeCamera camera(map.camera);
  std::vector<double> errors_m;
  for (const ScenePrediction& prediction : predictions) {
    const Eigen::Vector2d ray = *camera.Unproject(prediction.pixel);
    const Eigen::Vector3d p_CP =
        WallScene::Depth(view.X_WC, ray) * Eigen::Vector3d(ray.x(), ray.y(), 1.0);
    errors_m.push_back((prediction.p_WP - view.X_WC * p_CP).norm());
  }
  std::nth_element(errors_m.begin(), errors_m.begin() + 100, errors_m.end());
  EXPECT_LT(errors_m[100], 0.5);

  const auto refused = (*predictor)->Extract(Texture(1).Image(64, 64));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("must be 240 x 160"));
}

}  // namespace
}  // namespace relocd
