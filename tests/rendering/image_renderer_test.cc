#include "rendering/image_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "rendering/test_scenes.h"
#include "support/random.h"

namespace relocd {
namespace {

/// Renders a scene with one camera and light.
class Studio {
 public:
  Studio(const Scene& scene,
         const LightingOptions& light,
         const CameraIntrinsics& intrinsics,
         const ImageRendererOptions& options)
      : camera(intrinsics),
        tracer(RayTracer::Create(scene, {}).value()),
        lighting(light, scene.lamps),
        renderer(camera, *tracer, lighting, options) {}

  PinholeCamera camera;
  std::unique_ptr<RayTracer> tracer;
  Lighting lighting;
  ImageRenderer renderer;
};

ImageRendererOptions Samples(int samples_per_pixel) {
  return {.samples_per_pixel = samples_per_pixel, .threads = 2, .wetness = 0.0};
}

/// The middle and area of what shines within a rectangle of the image, weighted by how it shines.
struct Blob {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  double area = 0.0;
};

Blob BlobIn(const LinearImage& image, const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  Blob blob;
  for (int v = std::max(0, static_cast<int>(low.y()));
       v <= std::min(image.height - 1, static_cast<int>(high.y()));
       ++v) {
    for (int u = std::max(0, static_cast<int>(low.x()));
         u <= std::min(image.width - 1, static_cast<int>(high.x()));
         ++u) {
      const double weight = image.At(u, v)[0];
      blob.middle += weight * Eigen::Vector2d(u, v);
      blob.area += weight;
    }
  }
  blob.middle /= blob.area;
  return blob;
}

/// The same of a polygon, by the shoelace formula.
Blob BlobOf(const std::vector<Eigen::Vector2d>& corners) {
  Blob blob;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d& a = corners[i];
    const Eigen::Vector2d& b = corners[(i + 1) % corners.size()];
    const double cross = a.x() * b.y() - b.x() * a.y();
    blob.area += 0.5 * cross;
    blob.middle += cross / 6.0 * (a + b);
  }
  blob.middle /= blob.area;
  blob.area = std::abs(blob.area);
  return blob;
}

/// Where the camera sees an outline in W; nothing if it is not wholly within the image.
std::optional<std::vector<Eigen::Vector2d>> Project(const PinholeCamera& camera,
                                                    const Pose3& X_WC,
                                                    const std::vector<Eigen::Vector3d>& outline) {
  std::vector<Eigen::Vector2d> pixels;
  for (const Eigen::Vector3d& p_WQ : outline) {
    const auto pixel = camera.Project(X_WC.Inverse() * p_WQ);
    if (!pixel || pixel->minCoeff() < 1.0 || pixel->x() > camera.intrinsics().width - 2.0 ||
        pixel->y() > camera.intrinsics().height - 2.0) {
      return std::nullopt;
    }
    pixels.push_back(*pixel);
  }
  return pixels;
}

void ExpectBlob(const LinearImage& image, const std::vector<Eigen::Vector2d>& outline) {
  Eigen::Vector2d low = outline.front();
  Eigen::Vector2d high = low;
  for (const Eigen::Vector2d& pixel : outline) {
    low = low.cwiseMin(pixel);
    high = high.cwiseMax(pixel);
  }
  const Blob expected = BlobOf(outline);
  const Blob seen = BlobIn(image, low.array() - 2.0, high.array() + 3.0);
  EXPECT_LT((seen.middle - expected.middle).norm(), 0.05) << expected.middle.transpose();
  EXPECT_NEAR(seen.area, expected.area, 0.02 * expected.area);
}

/// The outline of a square, finely divided since lenses bend lines.
std::vector<Eigen::Vector3d> Square(const Eigen::Vector3d& corner,
                                    const Eigen::Vector3d& edge_u,
                                    const Eigen::Vector3d& edge_v) {
  constexpr int kSteps = 40;
  const std::array<Eigen::Vector3d, 5> corners{
      corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v, corner};
  std::vector<Eigen::Vector3d> outline;
  for (std::size_t side = 0; side < 4; ++side) {
    for (int i = 0; i < kSteps; ++i)
      outline.push_back(corners.at(side) + (corners.at(side + 1) - corners.at(side)) * i / kSteps);
  }
  return outline;
}

class ProjectionTest : public testing::TestWithParam<CameraIntrinsics> {};

TEST_P(ProjectionTest, TheSquaresOfABoardAreWhereTheCameraSays) {
  Scene scene;
  const std::uint32_t white = AddShining(scene, 1.0F);
  MeshBuilder builder;
  std::vector<std::vector<Eigen::Vector3d>> squares;
  const Eigen::Vector3d edge_u(0.4, 0.05, 0.0);
  const Eigen::Vector3d edge_v(0.0, 0.1, 0.4);
  for (int row = -2; row < 3; ++row) {
    for (int column = -3; column < 4; ++column) {
      // The white fields alone, with gaps so that none reaches into the window of another.
      const Eigen::Vector3d corner =
          Eigen::Vector3d(0.2, 4.0, 0.1) + 1.9 * column * edge_u + 1.9 * row * edge_v;
      squares.push_back(Square(corner, edge_u, edge_v));
      builder.AddQuad(corner.cast<float>(), edge_u.cast<float>(), edge_v.cast<float>(), white);
    }
  }
  Place(scene, builder);
  Studio studio(scene, NoLight(), GetParam(), Samples(64));
  // Looks along W's y axis, a little tilted.
  const Pose3 X_WC(RotationFromRollPitchYaw(-std::numbers::pi / 2.0 + 0.06, 0.04, 0.05),
                   {0.1, -0.2, 0.3});
  const LinearImage image = studio.renderer.Render(CameraSweep::AtRest(X_WC), 1);
  int checked = 0;
  for (const auto& square : squares) {
    if (const auto outline = Project(studio.camera, X_WC, square)) {
      ExpectBlob(image, *outline);
      ++checked;
    }
  }
  EXPECT_GT(checked, 20);
}

TEST_P(ProjectionTest, ASphereIsWhereTheCameraSays) {
  TestRandom random(5);
  for (int draw = 0; draw < 5; ++draw) {
    const Eigen::Vector3d middle_C(random.Uniform(-1.2, 1.2), random.Uniform(-0.8, 0.8), 4.0);
    const double radius_m = random.Uniform(0.3, 0.6);
    const Pose3 X_WC = random.SpatialPose();
    Scene scene;
    MeshBuilder builder;
    AddSphere(builder,
              (X_WC * middle_C).cast<float>(),
              static_cast<float>(radius_m),
              200,
              AddShining(scene, 1.0F));
    Place(scene, builder);
    // What is seen of a sphere ends at a circle, where lines of sight touch it.
    const double distance = middle_C.norm();
    const Eigen::Vector3d axis = middle_C / distance;
    const double sine = radius_m / distance;
    const Eigen::Vector3d across = axis.unitOrthogonal();
    const Eigen::Vector3d other = axis.cross(across);
    std::vector<Eigen::Vector3d> outline;
    for (int i = 0; i < 200; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / 200;
      const Eigen::Vector3d offset = std::cos(angle) * across + std::sin(angle) * other;
      outline.push_back(X_WC * (distance * (1.0 - sine * sine) * axis +
                                radius_m * std::sqrt(1.0 - sine * sine) * offset));
    }
    Studio studio(scene, NoLight(), GetParam(), Samples(64));
    const LinearImage image = studio.renderer.Render(CameraSweep::AtRest(X_WC), 2);
    const auto pixels = Project(studio.camera, X_WC, outline);
    ASSERT_TRUE(pixels) << draw;
    ExpectBlob(image, *pixels);
  }
}

TEST_P(ProjectionTest, TheDepthOfAPlaneIsThatOfTheClosedForm) {
  TestRandom random(6);
  for (int draw = 0; draw < 3; ++draw) {
    const Eigen::Vector3d point_C(0.0, 0.0, random.Uniform(2.0, 30.0));
    const Eigen::Vector3d normal_C =
        Eigen::Vector3d(random.Normal(0.3), random.Normal(0.3), -1.0).normalized();
    const Pose3 X_WC(random.Rotation(), random.Point3());
    const Eigen::Vector3d across = normal_C.unitOrthogonal();
    const Eigen::Vector3d other = normal_C.cross(across);
    Scene scene;
    MeshBuilder builder;
    constexpr double kSizeM = 400.0;
    const Eigen::Vector3d corner_C = point_C - 0.5 * kSizeM * (across + other);
    const Eigen::Matrix3d R_WC = X_WC.R();
    builder.AddQuad((X_WC * corner_C).cast<float>(),
                    (R_WC * (kSizeM * across)).cast<float>(),
                    (R_WC * (kSizeM * other)).cast<float>(),
                    AddPlain(scene, 0.5F));
    Place(scene, builder);
    Studio studio(scene, NoLight(), GetParam(), Samples(1));
    const DepthImage image = studio.renderer.RenderDepth(X_WC);
    int checked = 0;
    for (int v = 0; v < image.height; v += 7) {
      for (int u = 0; u < image.width; u += 7) {
        const auto ray = studio.camera.Unproject({u, v});
        if (!ray) continue;
        const Eigen::Vector3d p_C(ray->x(), ray->y(), 1.0);
        const double depth = point_C.dot(normal_C) / p_C.dot(normal_C);
        if (!(depth > 0.0) || depth > 60.0) continue;
        EXPECT_NEAR(
            image.depths_m[static_cast<std::size_t>(v * image.width + u)] / depth, 1.0, 1e-4);
        ++checked;
      }
    }
    EXPECT_GT(checked, 500);
  }
}

INSTANTIATE_TEST_SUITE_P(Cameras,
                         ProjectionTest,
                         testing::Values(TestIntrinsics(), DistortedIntrinsics()),
                         [](const auto& suite) {
                           return suite.param.distortion[0] == 0.0 ? "Pinhole" : "Distorted";
                         });

/// A ground with a roof over its half x < 0, seen from above through a hole in nothing.
Scene RoofScene(float albedo) {
  Scene scene;
  const std::uint32_t plain = AddPlain(scene, albedo);
  MeshBuilder builder;
  builder.AddQuad({-50, -50, 0}, {100, 0, 0}, {0, 100, 0}, plain);
  builder.AddQuad({-30, -50, 10}, {30, 0, 0}, {0, 100, 0}, plain);
  Place(scene, builder);
  return scene;
}

/// Between roof and ground, looking down.
Pose3 LookingDownFrom(const Eigen::Vector3d& position) {
  return {RotationFromRollPitchYaw(std::numbers::pi, 0.0, 0.0), position};
}

TEST(ImageRendererTest, ShadowsLieWhereTheSunPutsThem) {
  const Scene scene = RoofScene(0.5F);
  LightingOptions light;
  light.sun_azimuth_rad = 0.0;  // from +x, so that the roof's edge at x = 0 shades x < -10
  light.sun_elevation_rad = std::numbers::pi / 4.0;
  Studio studio(scene, light, TestIntrinsics(), Samples(4));
  const Pose3 X_WC = LookingDownFrom({-10, 0, 9});
  const LinearImage image = studio.renderer.Render(CameraSweep::AtRest(X_WC), 3);
  const auto at = [&](double x) {
    const Eigen::Vector2d pixel = *studio.camera.Project(X_WC.Inverse() * Eigen::Vector3d(x, 0, 0));
    return image.At(static_cast<int>(std::lround(pixel.x())),
                    static_cast<int>(std::lround(pixel.y())));
  };
  const Eigen::Array3f up_light = studio.lighting.AmbientIrradiance(Eigen::Vector3f::UnitZ());
  const Eigen::Array3f sun = std::sqrt(0.5F) * studio.lighting.sun_irradiance();
  EXPECT_TRUE(at(-9.0).isApprox(0.5F * (up_light + sun), 1e-3F)) << at(-9.0).transpose();
  EXPECT_TRUE(at(-11.0).isApprox(0.5F * up_light, 1e-3F)) << at(-11.0).transpose();
}

TEST(ImageRendererTest, WhatIsNearKeepsTheSkysLightAway) {
  Scene scene;
  const std::uint32_t plain = AddPlain(scene, 0.5F);
  MeshBuilder builder;
  builder.AddQuad({-50, -50, 0}, {100, 0, 0}, {0, 100, 0}, plain);
  builder.AddBox({0, -50, 0}, {1, 50, 20}, plain);
  Place(scene, builder);
  LightingOptions light;
  light.sun_strength = 0.0;
  Studio studio(scene, light, TestIntrinsics(), Samples(4));
  const Pose3 X_WC = LookingDownFrom({-5, 0, 12});
  const LinearImage image = studio.renderer.Render(CameraSweep::AtRest(X_WC), 3);
  const auto at = [&](double x) {
    const Eigen::Vector2d pixel = *studio.camera.Project(X_WC.Inverse() * Eigen::Vector3d(x, 0, 0));
    return image.At(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()))[1];
  };
  // Right at a wall half of the sky is hidden; far from it nothing.
  const float open = 0.5F * studio.lighting.AmbientIrradiance(Eigen::Vector3f::UnitZ())[1];
  EXPECT_NEAR(at(-8.0) / open, 1.0F, 1e-3F);
  EXPECT_NEAR(at(-0.1) / open, 0.6F, 0.1F);
}

TEST(ImageRendererTest, DependsOnTheSeedAndNotOnTheThreads) {
  const Scene scene = RoofScene(0.5F);
  const Pose3 X_WC = LookingDownFrom({-10, 0, 9});
  std::vector<LinearImage> images;
  for (const int threads : {1, 3, 7}) {
    Studio studio(scene, {}, TestIntrinsics(), {.samples_per_pixel = 4, .threads = threads});
    images.push_back(studio.renderer.Render(CameraSweep::AtRest(X_WC), 11));
  }
  const auto equal = [](const LinearImage& a, const LinearImage& b) {
    return std::equal(
        a.pixels.begin(), a.pixels.end(), b.pixels.begin(), [](const auto& x, const auto& y) {
          return (x == y).all();
        });
  };
  EXPECT_TRUE(equal(images[0], images[1]));
  EXPECT_TRUE(equal(images[0], images[2]));
  Studio studio(scene, {}, TestIntrinsics(), Samples(4));
  EXPECT_FALSE(equal(images[0], studio.renderer.Render(CameraSweep::AtRest(X_WC), 12)));
}

/// One upright shining bar on black, 1 m wide, 10 m ahead along W's y.
Scene BarScene() {
  Scene scene;
  MeshBuilder builder;
  builder.AddQuad({-0.5F, 10, -20}, {1, 0, 0}, {0, 0, 40}, AddShining(scene, 1.0F));
  Place(scene, builder);
  return scene;
}

Pose3 LookingAlongY(double x) {
  return {RotationFromRollPitchYaw(-std::numbers::pi / 2.0, 0.0, 0.0), {x, 0.0, 0.0}};
}

double MiddleOfRow(const LinearImage& image, int v) {
  double sum = 0.0;
  double weighted = 0.0;
  for (int u = 0; u < image.width; ++u) {
    sum += image.At(u, v)[0];
    weighted += image.At(u, v)[0] * static_cast<float>(u);
  }
  return weighted / sum;
}

TEST(ImageRendererTest, MotionBlursOverTheWayMade) {
  const Scene scene = BarScene();
  Studio studio(scene, NoLight(), TestIntrinsics(), Samples(64));
  const CameraSweep sweep{LookingAlongY(-0.5), LookingAlongY(0.5), 1.0};
  const LinearImage image = studio.renderer.Render(sweep, 1);
  // The bar is 21 px wide and moves as far: its profile is a triangle of 42 px.
  const int v = 120;
  const auto lit = std::count_if(image.pixels.begin() + v * image.width,
                                 image.pixels.begin() + (v + 1) * image.width,
                                 [](const Eigen::Array3f& pixel) { return pixel[0] > 0.0F; });
  EXPECT_NEAR(static_cast<double>(lit), 42.0, 2.0);
  EXPECT_NEAR(image.At(161, v)[0], 1.0F, 0.1F);
  EXPECT_NEAR(image.At(161 - 10, v)[0], 0.5F, 0.15F);
}

TEST(ImageRendererTest, ARollingShutterLeansWhatPassesBy) {
  const Scene scene = BarScene();
  Studio studio(scene, NoLight(), TestIntrinsics(), Samples(16));
  const CameraSweep sweep{LookingAlongY(-0.5), LookingAlongY(0.5), 0.0};
  const LinearImage image = studio.renderer.Render(sweep, 1);
  const double shift = MiddleOfRow(image, 0) - MiddleOfRow(image, image.height - 1);
  EXPECT_NEAR(shift, TestIntrinsics().fx * 1.0 / 10.0, 0.2);
}

TEST(ImageRendererTest, LampsShineOnlyWhenTheyAreOn) {
  Scene scene = RoofScene(0.5F);
  scene.lamps.push_back({.p_WL = {5, 0, 4}});
  LightingOptions light = NoLight();
  const Pose3 X_WC = LookingDownFrom({5, 0, 3});
  Studio lit(scene, light, TestIntrinsics(), Samples(1));
  const float below = lit.renderer.Render(CameraSweep::AtRest(X_WC), 1).At(161, 118)[0];
  // 8 at 1 m is 0.5 at 4 m; a half of it is reflected, evenly into all directions.
  EXPECT_NEAR(below, 0.5 * 0.5 / std::numbers::pi, 2e-3);
  light.lamps_on = false;
  Studio dark(scene, light, TestIntrinsics(), Samples(1));
  EXPECT_EQ(dark.renderer.Render(CameraSweep::AtRest(X_WC), 1).At(161, 118)[0], 0.0F);
}

TEST(ImageRendererTest, HazeTakesContrastWithDistance) {
  const Scene scene = BarScene();
  LightingOptions light = NoLight();
  light.haze_per_m = 0.05;
  Studio studio(scene, light, TestIntrinsics(), Samples(1));
  const LinearImage image = studio.renderer.Render(CameraSweep::AtRest(LookingAlongY(0.0)), 1);
  EXPECT_NEAR(image.At(161, 118)[0], std::exp(-0.05 * 10.0), 1e-3);
}

}  // namespace
}  // namespace relocd
