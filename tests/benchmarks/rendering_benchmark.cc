#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>

#include <benchmark/benchmark.h>

#include "rendering/image_renderer.h"
#include "rendering/test_scenes.h"

// What a frame costs: against the number of triangles, the image's size, and the samples.

namespace relocd {
namespace {

/// A street between walls of spheres, 60 m long.
Scene Street(int rings) {
  Scene scene;
  const std::uint32_t plain = AddPlain(scene, 0.5F);
  MeshBuilder builder;
  builder.AddQuad({-100, -100, 0}, {200, 0, 0}, {0, 200, 0}, plain);
  for (int i = 0; i < 20; ++i) {
    for (const float side : {-6.0F, 6.0F})
      AddSphere(builder, {side, 3.0F * static_cast<float>(i), 2.0F}, 2.0F, rings, plain);
  }
  Place(scene, builder);
  return scene;
}

CameraIntrinsics IntrinsicsOf(int width) {
  const double focal = 0.6 * width;
  const int height = width * 3 / 4;
  return {.fx = focal,
          .fy = focal,
          .cx = 0.5 * (width - 1),
          .cy = 0.5 * (height - 1),
          .width = width,
          .height = height};
}

/// Arguments: rings of a sphere, width of the image, samples a pixel.
void BM_RenderFrame(benchmark::State& state) {
  const Scene scene = Street(static_cast<int>(state.range(0)));
  const auto tracer = RayTracer::Create(scene, {}).value();
  const Lighting lighting(LightingOptions{}, {});
  const PinholeCamera camera(IntrinsicsOf(static_cast<int>(state.range(1))));
  const ImageRenderer renderer(
      camera,
      *tracer,
      lighting,
      {.samples_per_pixel = static_cast<int>(state.range(2)), .threads = 2, .wetness = 0.0});
  const Pose3 X_WC(RotationFromRollPitchYaw(-std::numbers::pi / 2.0, 0.0, 0.0), {0.0, -2.0, 1.5});
  for (auto _ : state)
    benchmark::DoNotOptimize(renderer.Render(CameraSweep::AtRest(X_WC), 1));
  state.SetItemsProcessed(state.iterations());
  state.counters["triangles"] = static_cast<double>(scene.CountTriangles());
}
BENCHMARK(BM_RenderFrame)
    ->Args({5, 640, 4})
    ->Args({20, 640, 4})
    ->Args({80, 640, 4})
    ->Args({160, 640, 4})
    ->Args({20, 320, 4})
    ->Args({20, 1280, 4})
    ->Args({20, 640, 1})
    ->Args({20, 640, 16})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace relocd
