#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include <benchmark/benchmark.h>

#include "smoothing/fixed_lag_smoother.h"
#include "smoothing/offline_smoother.h"
#include "support/allocation_counter.h"

namespace relocd {
namespace {

/// A body that drives in curves at 1 m/s, with odometry at 100 Hz and a fix each second.
class Driver {
 public:
  explicit Driver(int window_keyframes) : smoother_(MakeConfig(window_keyframes)) {
    // Keyframes are 0.5 m apart: so the window is full, and a fix stands on each second one.
    while (smoother_.window().keyframes.size() < static_cast<std::size_t>(window_keyframes)) {
      Drive();
    }
  }

  void Drive() {
    AddOdometrySteps();
    smoother_.AddFix(NextFix());
  }

  void AddOdometrySteps() {
    for (int i = 0; i < kStepsPerFix; ++i)
      AddOdometry();
  }

  void AddOdometry() {
    time_ += std::chrono::milliseconds(10);
    const Pose2 motion = Pose2::Exp({0.01, 0.0, 0.001});
    X_WB_ = X_WB_ * motion;
    benchmark::DoNotOptimize(
        smoother_.AddOdometry(MakeOdometryStep(time_, std::chrono::milliseconds(10), motion, {})));
  }

  [[nodiscard]] Fix NextFix() {
    // The same errors in each run: of sigma 0.2 m, and one in five 10 sigmas off.
    const double sigma = ++fixes_ % 5 == 0 ? 2.0 : 0.2;
    const Pose2 error(sigma * Draw(), sigma * Draw(), 0.1 * sigma * Draw());
    Fix fix = MakePoseFix(time_, X_WB_ * error, {});
    fix.covariance.diagonal() << 0.04, 0.04, 0.0004;
    return fix;
  }

  static constexpr int kStepsPerFix = 100;

  FixedLagSmoother& smoother() { return smoother_; }

 private:
  double Draw() { return normal_(engine_); }

  static SmootherConfig MakeConfig(int window_keyframes) {
    SmootherConfig config;
    config.window_keyframes = window_keyframes;
    config.keyframe_distance_m = 0.5;
    return config;
  }

  FixedLagSmoother smoother_;
  MonotonicTime time_{};
  Pose2 X_WB_;
  std::int64_t fixes_ = 0;
  std::mt19937 engine_{1};
  std::normal_distribution<double> normal_{0.0, 1.0};
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

/// The time that `share` of them do not exceed, in microseconds.
double Percentile(std::span<const float> times_us, double share) {
  if (times_us.empty()) return 0.0;
  std::vector<float> sorted(times_us.begin(), times_us.end());
  std::sort(sorted.begin(), sorted.end());
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

/// What a fix costs: the window solved again, and the newest covariance. Run for long, the first
/// and the last tenth say whether it stays so.
void BM_FixToEstimate(benchmark::State& state) {
  using Clock = std::chrono::steady_clock;
  Driver driver(static_cast<int>(state.range(0)));
  for (int i = 0; i < 100; ++i)
    driver.Drive();
  constexpr std::size_t kMostTimes = 10'000'000;
  std::vector<float> times_us;
  times_us.reserve(std::min(kMostTimes, static_cast<std::size_t>(state.max_iterations)));
  std::int64_t allocations = 0;
  for (auto _ : state) {
    const std::int64_t before = AllocationCount();
    driver.AddOdometrySteps();
    const Fix fix = driver.NextFix();
    const auto begin = Clock::now();
    benchmark::DoNotOptimize(driver.smoother().AddFix(fix));
    const std::chrono::duration<float, std::micro> taken = Clock::now() - begin;
    allocations += AllocationCount() - before;
    state.SetIterationTime(static_cast<double>(taken.count()) * 1e-6);
    if (times_us.size() < times_us.capacity()) times_us.push_back(taken.count());
  }
  const std::span<const float> all(times_us);
  const std::size_t tenth = std::max<std::size_t>(1, all.size() / 10);
  state.counters["p50_us"] = Percentile(all, 0.5);
  state.counters["p99_us"] = Percentile(all, 0.99);
  state.counters["max_us"] = Percentile(all, 1.0);
  state.counters["p99_first_us"] = Percentile(all.first(tenth), 0.99);
  state.counters["p99_last_us"] = Percentile(all.last(tenth), 0.99);
  state.counters["allocations"] = static_cast<double>(allocations);
}
BENCHMARK(BM_FixToEstimate)->Arg(100)->Arg(500)->UseManualTime();

}  // namespace
}  // namespace relocd
