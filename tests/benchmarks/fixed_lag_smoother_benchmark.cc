#include <chrono>
#include <cstddef>
#include <cstdint>

#include <benchmark/benchmark.h>

#include "smoothing/fixed_lag_smoother.h"
#include "smoothing/offline_smoother.h"

namespace relocd {
namespace {

/// A body that drives in curves at 1 m/s, with odometry at 100 Hz.
class Driver {
 public:
  explicit Driver(int window_keyframes) : smoother_(MakeConfig(window_keyframes)) {
    // Keyframes are 0.5 m apart: so the window is full, and a fix stands on each second one.
    while (smoother_.window().keyframes.size() < static_cast<std::size_t>(window_keyframes)) {
      for (int i = 0; i < kStepsPerFix; ++i)
        AddOdometry();
      smoother_.AddFix(NextFix());
    }
  }

  void AddOdometry() {
    time_ += std::chrono::milliseconds(10);
    const Pose2 motion = Pose2::Exp({0.01, 0.0, 0.001});
    X_WB_ = X_WB_ * motion;
    benchmark::DoNotOptimize(
        smoother_.AddOdometry(MakeOdometryStep(time_, std::chrono::milliseconds(10), motion, {})));
  }

  [[nodiscard]] Fix NextFix() {
    // The error of a fix is not random: each run does the same work.
    const double error = 0.2 * static_cast<double>(++fixes_ % 7 - 3) / 3.0;
    Fix fix = MakePoseFix(time_, X_WB_ * Pose2(error, -error, 0.1 * error), {});
    fix.covariance.diagonal() << 0.04, 0.04, 0.0004;
    return fix;
  }

  static constexpr int kStepsPerFix = 100;

  FixedLagSmoother& smoother() { return smoother_; }

 private:
  static SmootherConfig MakeConfig(int window_keyframes) {
    SmootherConfig config;
    config.window_keyframes = window_keyframes;
    return config;
  }

  FixedLagSmoother smoother_;
  MonotonicTime time_{};
  Pose2 X_WB_;
  std::int64_t fixes_ = 0;
};

/// What an ODOMETRY message costs: a step, and the estimate that is published.
void BM_OdometryToEstimate(benchmark::State& state) {
  Driver driver(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    driver.AddOdometry();
    benchmark::DoNotOptimize(driver.smoother().Estimate());
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(BM_OdometryToEstimate)->Arg(500);

/// What a fix costs: the window solved again, and the newest covariance.
void BM_FixToEstimate(benchmark::State& state) {
  Driver driver(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    state.PauseTiming();
    for (int i = 0; i < Driver::kStepsPerFix; ++i)
      driver.AddOdometry();
    const Fix fix = driver.NextFix();
    state.ResumeTiming();
    benchmark::DoNotOptimize(driver.smoother().AddFix(fix));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(BM_FixToEstimate)->Arg(100)->Arg(500);

}  // namespace
}  // namespace relocd
