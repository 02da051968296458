// The stage after the network: scene coordinates to pose, on one thread. Arguments: the number of
// correspondences and the percentage of outliers; 100 % is an image of somewhere else.

#include <cstdint>

#include <benchmark/benchmark.h>

#include "relocalization/camera_pose_estimator.h"
#include "relocalization/p3p.h"
#include "relocalization/packed_correspondences.h"
#include "relocalization/pose_refinement.h"
#include "relocalization/soft_inlier_score.h"
#include "relocalization/test_scene.h"

namespace relocd {
namespace {

Scene SceneFor(const benchmark::State& state) {
  return MakeScene({.correspondences = static_cast<std::size_t>(state.range(0)),
                    .outlier_share = static_cast<double>(state.range(1)) / 100.0,
                    .pixel_sigma_px = 2.0},
                   1);
}

void BM_EstimateCameraPose(benchmark::State& state) {
  const Scene scene = SceneFor(state);
  const PinholeCamera camera = scene.camera();
  std::uint64_t seed = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        EstimateCameraPose(scene.correspondences, camera, {}, std::nullopt, seed++));
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(BM_EstimateCameraPose)
    ->ArgsProduct({{1200, 4800, 7038}, {20, 50, 80, 100}})
    ->Unit(benchmark::kMicrosecond);

void BM_SolveP3p(benchmark::State& state) {
  const Scene scene = MakeScene({}, 1);
  const PackedCorrespondences packed(scene.correspondences, scene.camera(), 1);
  std::size_t i = 0;
  for (auto _ : state) {
    Eigen::Matrix3d rays_C;
    Eigen::Matrix3d p_MPs;
    for (Eigen::Index column = 0; column < 3; ++column) {
      i = (i + 1) % packed.size();
      rays_C.col(column) = packed.Ray_C(i);
      p_MPs.col(column) = packed.p_MP(i);
    }
    benchmark::DoNotOptimize(SolveP3p(rays_C, p_MPs));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(BM_SolveP3p);

CameraFromWorld TruePose(const Scene& scene, const PackedCorrespondences& packed) {
  const Eigen::Matrix3d R_CW = scene.X_WC.R().transpose();
  return {.R_CW = R_CW, .p_CW = R_CW * (packed.p_WM() - scene.X_WC.translation())};
}

void BM_PackCorrespondences(benchmark::State& state) {
  const Scene scene = SceneFor(state);
  const PinholeCamera camera = scene.camera();
  for (auto _ : state) {
    benchmark::DoNotOptimize(PackedCorrespondences(scene.correspondences, camera, 1));
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(BM_PackCorrespondences)->Args({1200, 50})->Args({4800, 50});

void BM_SoftInlierScore(benchmark::State& state) {
  const Scene scene = SceneFor(state);
  const PackedCorrespondences packed(scene.correspondences, scene.camera(), 1);
  const CameraFromWorld X_CM = TruePose(scene, packed);
  for (auto _ : state)
    benchmark::DoNotOptimize(SoftInlierScore(packed, packed.size(), X_CM, 10.0));
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(BM_SoftInlierScore)->Args({600, 50})->Args({4800, 50});

void BM_RefinePose(benchmark::State& state) {
  const Scene scene = SceneFor(state);
  const PackedCorrespondences packed(scene.correspondences, scene.camera(), 1);
  const CameraFromWorld X_CM = TruePose(scene, packed);
  for (auto _ : state)
    benchmark::DoNotOptimize(RefinePose(packed, packed.size(), X_CM, {}));
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(BM_RefinePose)->Args({1200, 50})->Args({4800, 50})->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace relocd
