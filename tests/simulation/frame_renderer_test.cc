#include "simulation/frame_renderer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulation/test_world.h"

namespace relocd {
namespace {

FrameRendererOptions SmallCamera() {
  FrameRendererOptions options;
  options.intrinsics = {.fx = 60.0, .fy = 60.0, .cx = 63.5, .cy = 47.5, .width = 128, .height = 96};
  options.samples_per_pixel = 1;
  options.seed = 9;
  return options;
}

/// Ahead along the route at 7 m/s.
Pose3 CameraAt(std::int64_t time_ns) {
  const Pose3 X_BC(RotationFromRollPitchYaw(-std::numbers::pi / 2.0, 0.0, -std::numbers::pi / 2.0),
                   {0.0, 0.0, 1.5});
  const Eigen::Vector3d position(10.0 + 7e-9 * static_cast<double>(time_ns), -1.5, 0.0);
  return Pose3(Eigen::Quaterniond::Identity(), position) * X_BC;
}

std::vector<RgbImage> Drive(const World& world,
                            const std::string& session,
                            const FrameRendererOptions& options,
                            int frames) {
  auto renderer = FrameRenderer::Create(world, ParseSession(session).value(), options).value();
  std::vector<RgbImage> images;
  for (int i = 0; i < frames; ++i)
    images.push_back(renderer->Render(i * 100'000'000LL, CameraAt));
  return images;
}

double MeanOf(const RgbImage& image) {
  return std::accumulate(image.pixels.begin(), image.pixels.end(), 0.0) /
         static_cast<double>(image.pixels.size());
}

double MeanDifference(const RgbImage& a, const RgbImage& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    sum += std::abs(static_cast<double>(a.pixels[i]) - b.pixels[i]);
  return sum / static_cast<double>(a.pixels.size());
}

TEST(FrameRendererTest, TheSameDriveGivesTheSamePicturesWithAnyNumberOfThreads) {
  const World world = StraightWorld();
  FrameRendererOptions options = SmallCamera();
  const auto first = Drive(world, "noon+traffic+hunting+dirty+rain", options, 3);
  options.threads = 5;
  const auto second = Drive(world, "noon+traffic+hunting+dirty+rain", options, 3);
  for (std::size_t i = 0; i < first.size(); ++i)
    EXPECT_EQ(first[i].pixels, second[i].pixels) << i;
  options.seed = 10;
  EXPECT_NE(first[0].pixels, Drive(world, "noon+traffic+hunting+dirty+rain", options, 1)[0].pixels);
}

TEST(FrameRendererTest, TheExposureMakesAllSessionsVisible) {
  const World world = StraightWorld();
  for (const SessionTrait& trait : SessionTraits()) {
    const RgbImage image = Drive(world, trait.name, SmallCamera(), 6).back();
    EXPECT_GT(MeanOf(image), 50.0) << trait.name;
    EXPECT_LT(MeanOf(image), 210.0) << trait.name;
  }
}

TEST(FrameRendererTest, SessionsLookDifferent) {
  const World world = StraightWorld();
  const RgbImage noon = Drive(world, "noon", SmallCamera(), 3).back();
  for (const char* other : {"overcast", "evening", "dusk", "rain", "dirty", "haze", "reparked"})
    EXPECT_GT(MeanDifference(noon, Drive(world, other, SmallCamera(), 3).back()), 1.0) << other;
}

TEST(FrameRendererTest, RefusesOptionsOutOfRangeAndBrokenWorlds) {
  const World world = StraightWorld();
  FrameRendererOptions options = SmallCamera();
  options.samples_per_pixel = 0;
  auto refused = FrameRenderer::Create(world, Session{}, options);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message,
              testing::HasSubstr("camera: samples_per_pixel is 0, must be in [1, 64]"));
  options = SmallCamera();
  options.rolling_shutter_s = -1.0;
  EXPECT_FALSE(FrameRenderer::Create(world, Session{}, options));
  World broken = StraightWorld();
  broken.scene.instances[0].mesh = 77;
  refused = FrameRenderer::Create(broken, Session{}, SmallCamera());
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("world straight: instance 0: mesh 77"));
}

}  // namespace
}  // namespace relocd
