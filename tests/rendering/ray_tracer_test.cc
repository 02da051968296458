#include "rendering/ray_tracer.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "rendering/test_scenes.h"
#include "support/random.h"

namespace relocd {
namespace {

Eigen::Vector3f RandomUnit(TestRandom& random) {
  return Eigen::Vector3d(random.Normal(1.0), random.Normal(1.0), random.Normal(1.0))
      .normalized()
      .cast<float>();
}

std::unique_ptr<RayTracer> Trace(const Scene& scene) {
  return RayTracer::Create(scene, {}).value();
}

Hit HitOf(const RayTracer& tracer, const Ray& ray) {
  Hit hit;
  tracer.Intersect(std::span(&ray, 1), 0.0F, std::span(&hit, 1));
  return hit;
}

bool IsOccluded(const RayTracer& tracer, const Ray& ray) {
  std::uint8_t occluded = 0;
  tracer.Occluded(std::span(&ray, 1), 0.0F, std::span(&occluded, 1));
  return occluded != 0;
}

Ray RayFrom(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) {
  Ray ray;
  ray.origin = origin;
  ray.direction = direction.normalized();
  return ray;
}

TEST(RayTracerTest, MeetsABoxWhereTheSlabMethodSays) {
  Scene scene;
  MeshBuilder builder;
  builder.AddBox({-1, -2, -3}, {1, 2, 3}, AddPlain(scene, 0.5F));
  Place(scene, builder);
  const auto tracer = Trace(scene);
  TestRandom random(3);
  for (int draw = 0; draw < 1000; ++draw) {
    const Ray ray = RayFrom(9.0F * RandomUnit(random), RandomUnit(random));
    float enter = 0.0F;
    float leave = 1e9F;
    const std::array<float, 3> half{1, 2, 3};
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const float extent = half.at(static_cast<std::size_t>(axis));
      const float a = (-extent - ray.origin[axis]) / ray.direction[axis];
      const float b = (extent - ray.origin[axis]) / ray.direction[axis];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    const Hit hit = HitOf(*tracer, ray);
    ASSERT_EQ(hit.is_hit(), enter < leave) << draw;
    EXPECT_EQ(IsOccluded(*tracer, ray), hit.is_hit());
    if (hit.is_hit()) {
      EXPECT_NEAR(hit.distance, enter, 1e-4F) << draw;
    }
  }
}

TEST(RayTracerTest, SurfacesFaceTheRayAndLieWhereItEnds) {
  Scene scene;
  MeshBuilder builder;
  builder.AddQuad({-5, -5, 0}, {10, 0, 0}, {0, 10, 0}, AddPlain(scene, 0.3F));
  Place(scene, builder);
  const auto tracer = Trace(scene);
  for (const float side : {1.0F, -1.0F}) {
    const Ray ray = RayFrom({1, 2, side * 4}, {0, 0, -side});
    const Hit hit = HitOf(*tracer, ray);
    ASSERT_TRUE(hit.is_hit());
    const Surface surface = tracer->SurfaceAt(ray, hit, 0.0F);
    EXPECT_TRUE(surface.normal.isApprox(Eigen::Vector3f(0, 0, side)));
    EXPECT_TRUE(surface.position.isApprox(Eigen::Vector3f(1, 2, 0)));
    EXPECT_FLOAT_EQ(surface.albedo[0], 0.3F);
  }
}

TEST(RayTracerTest, InstancesAreTurnedMovedAndScaled) {
  Scene scene;
  MeshBuilder builder;
  builder.AddBox({0, 0, 0}, {1, 1, 1}, AddPlain(scene, 0.5F));
  Place(scene, builder);
  const float angle = 0.5F;
  Eigen::Affine3f X_WM = Eigen::Translation3f(10, 0, 0) *
                         Eigen::AngleAxisf(angle, Eigen::Vector3f::UnitZ()) *
                         Eigen::Scaling(2.0F, 3.0F, 1.0F);
  scene.instances.push_back({.mesh = 0, .X_WM = X_WM});
  const auto tracer = Trace(scene);
  // Into the middle of the face whose normal is -y in M.
  const Eigen::Vector3f target = X_WM * Eigen::Vector3f(0.5F, 0.0F, 0.5F);
  const Eigen::Vector3f normal(std::sin(angle), -std::cos(angle), 0.0F);
  const Ray ray = RayFrom(target + 5.0F * normal, -normal);
  const Hit hit = HitOf(*tracer, ray);
  ASSERT_TRUE(hit.is_hit());
  EXPECT_NEAR(hit.distance, 5.0F, 1e-4F);
  EXPECT_TRUE(tracer->SurfaceAt(ray, hit, 0.0F).normal.isApprox(normal, 1e-4F));
}

TEST(RayTracerTest, RaysPassWhereTheTextureLeavesTheSurfaceOut) {
  Scene scene;
  // The left half is a hole.
  std::vector<std::uint8_t> rgba;
  for (int i = 0; i < 64 * 64; ++i) {
    const std::uint8_t alpha = i % 64 < 32 ? 0 : 255;
    rgba.insert(rgba.end(), {100, 100, 100, alpha});
  }
  Material leaves;
  leaves.texture = static_cast<int>(scene.AddTexture(Texture::Create(64, 64, rgba).value()));
  leaves.alpha_cutoff = 0.5F;
  MeshBuilder builder;
  builder.AddPicture({0, 0, 0}, {2, 0, 0}, {0, 0, 2}, scene.AddMaterial(leaves));
  Place(scene, builder);
  for (const bool instanced : {false, true}) {
    if (instanced) {
      MeshInstance elsewhere{.mesh = 0};
      elsewhere.X_WM.translation().z() = 100.0F;
      scene.instances.push_back(elsewhere);
    }
    const auto tracer = Trace(scene);
    EXPECT_FALSE(HitOf(*tracer, RayFrom({0.5F, -1, 1}, {0, 1, 0})).is_hit());
    EXPECT_TRUE(HitOf(*tracer, RayFrom({1.5F, -1, 1}, {0, 1, 0})).is_hit());
    EXPECT_FALSE(IsOccluded(*tracer, RayFrom({0.5F, -1, 1}, {0, 1, 0})));
    EXPECT_TRUE(IsOccluded(*tracer, RayFrom({1.5F, -1, 1}, {0, 1, 0})));
  }
}

TEST(RayTracerTest, WhatMovesIsWhereTheTimeSays) {
  Scene scene;
  MeshBuilder builder;
  builder.AddBox({-0.5F, -0.5F, -0.5F}, {0.5F, 0.5F, 0.5F}, AddPlain(scene, 0.5F));
  const std::uint32_t mesh = scene.AddMesh(builder.Take());
  const auto tracer = Trace(scene);
  MovingMesh moving{.mesh = mesh};
  moving.X_WM_end.translation().x() = 4.0F;
  const std::array<MovingMesh, 1> all{moving};
  tracer->SetMoving(all);
  for (const float time : {0.0F, 0.25F, 0.5F, 1.0F}) {
    Ray ray = RayFrom({4.0F * time, -10, 0}, {0, 1, 0});
    ray.time = time;
    const Hit hit = HitOf(*tracer, ray);
    ASSERT_TRUE(hit.is_hit()) << time;
    EXPECT_NEAR(hit.distance, 9.5F, 1e-4F);
    EXPECT_TRUE(tracer->SurfaceAt(ray, hit, 0.0F).normal.isApprox(Eigen::Vector3f(0, -1, 0)));
    ray.time = time < 0.5F ? 1.0F : 0.0F;
    EXPECT_FALSE(HitOf(*tracer, ray).is_hit()) << time;
  }
  tracer->SetMoving({});
  EXPECT_FALSE(HitOf(*tracer, RayFrom({0, -10, 0}, {0, 1, 0})).is_hit());
}

TEST(RayTracerTest, ManyRaysAreTracedAsEachAlone) {
  Scene scene;
  MeshBuilder builder;
  AddSphere(builder, {0, 0, 0}, 1.0F, 20, AddPlain(scene, 0.5F));
  Place(scene, builder);
  const auto tracer = Trace(scene);
  TestRandom random(4);
  std::vector<Ray> rays;
  for (int i = 0; i < 101; ++i)
    rays.push_back(RayFrom({-3, 0, 0}, Eigen::Vector3f(3, 0, 0) + 1.5F * RandomUnit(random)));
  std::vector<Hit> hits(rays.size());
  tracer->Intersect(rays, 0.0F, hits);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Hit alone = HitOf(*tracer, rays[i]);
    EXPECT_EQ(hits[i].is_hit(), alone.is_hit());
    EXPECT_EQ(hits[i].triangle, alone.triangle);
  }
}

TEST(RayTracerTest, RefusesABrokenScene) {
  Scene scene;
  scene.instances.push_back({.mesh = 0});
  EXPECT_FALSE(RayTracer::Create(scene, {}));
  const std::array<MeshInstance, 1> more{MeshInstance{.mesh = 2}};
  EXPECT_FALSE(RayTracer::Create(Scene{}, more));
}

}  // namespace
}  // namespace relocd
