#include "scene_coordinates/plane_sweep.h"

#include <algorithm>
#include <memory>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene_coordinates/wall_scene.h"

namespace relocd {
namespace {

/// Gradients of the views, and what a sweep needs to know of them.
struct SweptScene {
  explicit SweptScene(const std::vector<TrainingImage>& views) {
    for (const TrainingImage& view : views) {
      extractors.push_back(GradientHistograms::Create(WallScene::Features()).value());
      EXPECT_TRUE(extractors.back()->Extract(view.image, 100'000, features));
      sweep_views.push_back({&extractors.back()->maps(), view.X_WC});
    }
  }
  std::vector<std::unique_ptr<GradientHistograms>> extractors;
  std::vector<SweepView> sweep_views;
  CellFeatures features;
};

TEST(PlaneSweepTest, FindsTheDepthOfAWall) {
  const PinholeCamera camera(WallScene::Intrinsics());
  const SweptScene scene(WallScene().Drive(5));
  const std::vector<SweepView> neighbours = {
      scene.sweep_views[0], scene.sweep_views[1], scene.sweep_views[3], scene.sweep_views[4]};
  const PlaneSweep sweep(camera, *scene.extractors[2], {});
  const std::vector<float> inverse_depths =
      sweep.InverseDepths(scene.sweep_views[2], neighbours, scene.features.pixels);
  std::vector<double> errors;
  for (std::size_t cell = 0; cell < inverse_depths.size(); ++cell) {
    if (inverse_depths[cell] == 0.0F) continue;
    const Eigen::Vector2d ray = *camera.Unproject(scene.features.pixels[cell].cast<double>());
    const double depth = WallScene::Depth(scene.sweep_views[2].X_WC, ray);
    errors.push_back(std::abs(1.0 / static_cast<double>(inverse_depths[cell]) / depth - 1.0));
  }
  ASSERT_GT(errors.size(), inverse_depths.size() / 2);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.03);
  EXPECT_LT(errors[errors.size() * 9 / 10], 0.1);
}

TEST(PlaneSweepTest, FindsNoDepthWithoutParallax) {
  const PinholeCamera camera(WallScene::Intrinsics());
  const WallScene wall;
  const SweptScene scene({wall.View(Pose3()),
                          wall.View(Pose3(Eigen::Quaterniond::Identity(), {0.001, 0.0, 0.0})),
                          wall.View(Pose3(Eigen::Quaterniond::Identity(), {-0.001, 0.0, 0.0}))});
  const PlaneSweep sweep(camera, *scene.extractors[0], {});
  const auto inverse_depths = sweep.InverseDepths(
      scene.sweep_views[0], std::span(scene.sweep_views).subspan(1), scene.features.pixels);
  EXPECT_THAT(inverse_depths, testing::Each(0.0F));
}

}  // namespace
}  // namespace relocd
