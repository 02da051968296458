#include "scene_coordinates/head_trainer.h"

#include <algorithm>
#include <barrier>
#include <cmath>
#include <memory>
#include <numbers>
#include <numeric>
#include <random>
#include <thread>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <omp.h>
#include <oneapi/dnnl/dnnl.hpp>

#include "core/check.h"
#include "scene_coordinates/head_optimizer.h"
#include "scene_coordinates/scene_loss.h"
#include "scene_coordinates/shard_network.h"

#define RELOCD_VECTORISED __attribute__((target_clones("default", "arch=x86-64-v3")))

namespace relocd {
namespace {

constexpr int kReportEvery = 50;

/// Into the first shard's gradient: the mean over the batch of what each shard has summed up.
RELOCD_VECTORISED void AverageShards(float* gradients,
                                     std::size_t stride,
                                     std::size_t size,
                                     float scale) {
  static_assert(kTrainerShards == 4);
  for (std::size_t i = 0; i < size; ++i) {
    gradients[i] = scale * ((gradients[i] + gradients[stride + i]) +
                            (gradients[2 * stride + i] + gradients[3 * stride + i]));
  }
}

RELOCD_VECTORISED void Narrow(const float* in, std::size_t size, Bfloat16* out) {
  for (std::size_t i = 0; i < size; ++i) {
    out[i] = ToBfloat16(in[i]);
  }
}
void Narrow(const float* in, std::size_t size, float* out) {
  std::copy_n(in, size, out);
}

/// A feature as the network takes it.
template <typename Number>
Number As(Bfloat16 value) {
  if constexpr (std::is_same_v<Number, Bfloat16>) {
    return value;
  } else {
    return ToFloat(value);
  }
}

/// The one cycle of the learning rates, as a share of the highest: up along a line, down along a
/// cosine.
double RateShare(const HeadTrainerConfig& config, int iteration) {
  constexpr double kFirst = 0.04;
  constexpr double kLast = 0.002;
  const double progress = static_cast<double>(iteration) / config.iterations;
  if (progress < config.warm_up) return kFirst + (1.0 - kFirst) * progress / config.warm_up;
  const double down = (progress - config.warm_up) / (1.0 - config.warm_up);
  return kLast + (1.0 - kLast) * 0.5 * (1.0 + std::cos(std::numbers::pi * down));
}

/// Logarithmic until most points are about right, in the share of the iterations that this takes.
RobustShape Shape(const HeadTrainerConfig& config, int iteration) {
  constexpr double kFar = 0.65;
  return iteration < kFar * config.iterations ? RobustShape::kLogarithm : RobustShape::kTanh;
}

/// Wide for most of the training, then closing fast: a quarter of an ellipse.
double Tolerance(const HeadTrainerConfig& config, int iteration) {
  const double progress = static_cast<double>(iteration) / config.iterations;
  return config.final_tolerance_px + (config.initial_tolerance_px - config.final_tolerance_px) *
                                         std::sqrt(1.0 - progress * progress);
}

/// The loss of one shard's cells, and what it adds up to.
class ShardLoss final : public OutputLoss {
 public:
  ShardLoss(const TrainingSet& set, const std::vector<LossCamera>& cameras)
      : set_(set), cameras_(cameras) {}

  void Begin(const SceneLossConfig& config, std::span<const std::uint32_t> cells) {
    config_ = config;
    cells_ = cells;
    loss_ = 0.0;
    errors_px_.clear();
  }

  void Evaluate(std::span<const float> outputs, std::span<float> gradients) override {
    for (std::size_t row = 0; row < cells_.size(); ++row) {
      const TrainingTarget& target = set_.targets[cells_[row]];
      const std::span<const float, kHeadOutputs> output(outputs.data() + row * kHeadOutputs,
                                                        kHeadOutputs);
      const SceneLoss loss = EvaluateSceneLoss(config_, cameras_[target.image], target, output);
      std::copy(loss.gradient.begin(),
                loss.gradient.end(),
                gradients.begin() + static_cast<std::ptrdiff_t>(row * kHeadOutputs));
      loss_ += loss.loss;
      if (loss.valid) errors_px_.push_back(loss.error_px);
    }
  }

  [[nodiscard]] double loss() const { return loss_; }
  [[nodiscard]] const std::vector<float>& errors_px() const { return errors_px_; }

 private:
  const TrainingSet& set_;
  const std::vector<LossCamera>& cameras_;
  SceneLossConfig config_;
  std::span<const std::uint32_t> cells_;
  double loss_ = 0.0;
  std::vector<float> errors_px_;
};

/// One training: state that all threads share, and what each thread does in turn.
template <typename Number>
class Trainer {
 public:
  Trainer(const TrainingSet& set,
          const HeadTrainerConfig& config,
          Precision precision,
          const TrainerHooks& hooks);

  /// Continues from there instead of from the beginning.
  Result<void> Resume(const TrainerState& state);
  Head Run();

 private:
  void RunThread(std::size_t thread, std::barrier<>& barrier);
  void RunShard(std::size_t thread, std::size_t shard);
  void UpdateLayers(std::size_t thread);
  /// By one thread, between the steps of all.
  void Advance();
  void Report();
  void ShowState();
  void TakeBatch();
  void BeginStep();

  const TrainingSet& set_;
  const HeadTrainerConfig& config_;
  const TrainerHooks& hooks_;
  std::mt19937_64 engine_;
  Head head_;
  ParameterLayout layout_;
  std::vector<float> parameters_;
  std::vector<Number> narrow_parameters_;
  HeadOptimizer optimizer_;
  std::vector<float> gradients_;  ///< kTrainerShards x layout_.size()
  std::vector<LossCamera> cameras_;
  std::vector<std::unique_ptr<ShardNetwork<Number>>> networks_;  ///< One a thread.
  std::vector<std::unique_ptr<ShardLoss>> losses_;               ///< One a shard.
  std::vector<std::uint32_t> order_;
  std::size_t next_in_order_ = 0;
  int iteration_ = 0;
  double loss_since_report_ = 0.0;
  OptimizerStep step_;
  SceneLossConfig loss_config_;
};

/// Where the scene is, roughly: half of it around the cameras.
void PlaceHead(const TrainingSet& set, Head& head) {
  for (const Pose3& X_WC : set.X_WCs) {
    head.centre_W += X_WC.translation() / static_cast<double>(set.X_WCs.size());
  }
  double squares = 0.0;
  for (const Pose3& X_WC : set.X_WCs) {
    squares += (X_WC.translation() - head.centre_W).squaredNorm();
  }
  head.scale_m = std::sqrt(squares / static_cast<double>(set.X_WCs.size())) + set.typical_depth_m;
}

template <typename Number>
Trainer<Number>::Trainer(const TrainingSet& set,
                         const HeadTrainerConfig& config,
                         Precision precision,
                         const TrainerHooks& hooks)
    : set_(set),
      config_(config),
      hooks_(hooks),
      engine_(config.seed),
      head_(MakeRandomHead(config.shape, engine_())),
      layout_(config.shape),
      parameters_(FlattenHead(head_, layout_)),
      narrow_parameters_(layout_.size()),
      optimizer_(layout_, precision),
      gradients_(kTrainerShards * layout_.size()),
      order_(set.targets.size()) {
  Narrow(parameters_.data(), parameters_.size(), narrow_parameters_.data());
  PlaceHead(set, head_);
  for (const Pose3& X_WC : set.X_WCs) {
    cameras_.push_back(MakeLossCamera(X_WC, head_.centre_W));
  }
  const auto shard_rows = static_cast<std::size_t>(config.batch / kTrainerShards);
  const int threads = std::min(config.threads, kTrainerShards);
  for (int thread = 0; thread < threads; ++thread) {
    networks_.push_back(std::make_unique<ShardNetwork<Number>>(
        layout_, shard_rows, parameters_.data(), narrow_parameters_.data()));
  }
  for (int shard = 0; shard < kTrainerShards; ++shard) {
    losses_.push_back(std::make_unique<ShardLoss>(set, cameras_));
  }
  std::iota(order_.begin(), order_.end(), 0U);
  next_in_order_ = order_.size();
}

template <typename Number>
Result<void> Trainer<Number>::Resume(const TrainerState& state) {
  const auto fits = [&](const std::vector<float>& values) {
    return values.size() == layout_.size();
  };
  if (state.iteration < 1 || state.iteration >= config_.iterations || !fits(state.parameters) ||
      !fits(state.momentum) || !fits(state.variance)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("the state to go on from is at iteration {} of {} with {} parameters, "
                             "must be before the end and have {}",
                             state.iteration,
                             config_.iterations,
                             state.parameters.size(),
                             layout_.size())};
  }
  parameters_ = state.parameters;
  optimizer_.Restore(state.momentum, state.variance);
  Narrow(parameters_.data(), parameters_.size(), narrow_parameters_.data());
  for (; iteration_ < state.iteration; ++iteration_) {  // draw the same order of cells
    TakeBatch();
    next_in_order_ += static_cast<std::size_t>(config_.batch);
  }
  return {};
}

template <typename Number>
Head Trainer<Number>::Run() {
  std::barrier<> barrier(std::ssize(networks_));
  BeginStep();
  std::vector<std::jthread> threads;
  for (std::size_t thread = 1; thread < networks_.size(); ++thread)
    threads.emplace_back([this, thread, &barrier] { RunThread(thread, barrier); });
  RunThread(0, barrier);
  threads.clear();  // joins them
  UnflattenHead(layout_, parameters_, head_);
  return std::move(head_);
}

template <typename Number>
void Trainer<Number>::RunThread(std::size_t thread, std::barrier<>& barrier) {
  omp_set_num_threads(1);  // of this thread: oneDNN is not to start more
  while (iteration_ < config_.iterations) {
    for (std::size_t shard = thread; shard < kTrainerShards; shard += networks_.size()) {
      RunShard(thread, shard);
    }
    barrier.arrive_and_wait();
    UpdateLayers(thread);
    barrier.arrive_and_wait();
    if (thread == 0) Advance();
    barrier.arrive_and_wait();
  }
}

template <typename Number>
void Trainer<Number>::RunShard(std::size_t thread, std::size_t shard) {
  const auto rows = static_cast<std::size_t>(config_.batch / kTrainerShards);
  const auto cells =
      std::span<const std::uint32_t>{order_}.subspan(next_in_order_ + shard * rows, rows);
  ShardNetwork<Number>& network = *networks_[thread];
  const auto dimension = static_cast<std::size_t>(set_.dimension);
  for (std::size_t row = 0; row < rows; ++row) {
    const Bfloat16* features = set_.features.data() + cells[row] * dimension;
    std::transform(features, features + dimension, network.InputRow(row).begin(), As<Number>);
  }
  losses_[shard]->Begin(loss_config_, cells);
  network.Run(*losses_[shard],
              std::span<float>{gradients_}.subspan(shard * layout_.size(), layout_.size()));
}

template <typename Number>
void Trainer<Number>::UpdateLayers(std::size_t thread) {
  const float mean = 1.0F / static_cast<float>(config_.batch);
  const auto layers = static_cast<std::size_t>(layout_.shape().layer_count());
  for (std::size_t layer = thread; layer < layers; layer += networks_.size()) {
    const auto index = static_cast<int>(layer);
    const std::size_t begin = layout_.WeightsBegin(index);
    const std::size_t end = layer + 1 == layers ? layout_.size() : layout_.WeightsBegin(index + 1);
    AverageShards(gradients_.data() + begin, layout_.size(), end - begin, mean);
    optimizer_.UpdateLayer(
        index, step_, std::span<float>{gradients_}.first(layout_.size()), parameters_);
    Narrow(parameters_.data() + begin, end - begin, narrow_parameters_.data() + begin);
  }
}

template <typename Number>
void Trainer<Number>::Advance() {
  next_in_order_ += static_cast<std::size_t>(config_.batch);
  ++iteration_;
  for (const auto& loss : losses_) {
    loss_since_report_ += loss->loss();
  }
  if (iteration_ % kReportEvery == 0 || iteration_ == config_.iterations) Report();
  if (iteration_ == config_.iterations) return;
  if (hooks_.state && hooks_.state_every > 0 && iteration_ % hooks_.state_every == 0) ShowState();
  BeginStep();
}

template <typename Number>
void Trainer<Number>::ShowState() {
  Head head = head_;
  UnflattenHead(layout_, parameters_, head);
  hooks_.state({iteration_, parameters_, optimizer_.momentum(), optimizer_.variance()}, head);
}

template <typename Number>
void Trainer<Number>::Report() {
  std::vector<float> errors_px;
  for (const auto& loss : losses_) {
    errors_px.insert(errors_px.end(), loss->errors_px().begin(), loss->errors_px().end());
  }
  TrainingProgress report;
  report.iteration = iteration_;
  report.iterations = config_.iterations;
  const int since = (iteration_ - 1) % kReportEvery + 1;
  report.loss = loss_since_report_ / (static_cast<double>(since) * config_.batch);
  report.valid = static_cast<double>(errors_px.size()) / config_.batch;
  if (!errors_px.empty()) {
    const auto middle = errors_px.begin() + std::ssize(errors_px) / 2;
    std::nth_element(errors_px.begin(), middle, errors_px.end());
    report.median_error_px = *middle;
  }
  loss_since_report_ = 0.0;
  if (hooks_.progress) hooks_.progress(report);
}

/// Shuffles the cells anew when too few are left of the last time.
template <typename Number>
void Trainer<Number>::TakeBatch() {
  if (next_in_order_ + static_cast<std::size_t>(config_.batch) > order_.size()) {
    std::shuffle(order_.begin(), order_.end(), engine_);
    next_in_order_ = 0;
  }
}

template <typename Number>
void Trainer<Number>::BeginStep() {
  TakeBatch();
  const double share = RateShare(config_, iteration_);
  step_ = {.iteration = iteration_,
           .matrix_rate = share * config_.matrix_learning_rate,
           .rate = share * config_.learning_rate,
           .weight_decay = config_.weight_decay};
  loss_config_ = {.focal_px = static_cast<float>(set_.focal_px),
                  .shape = Shape(config_, iteration_),
                  .tolerance_px = static_cast<float>(Tolerance(config_, iteration_)),
                  .depth_baseline_m = static_cast<float>(config_.depth_baseline_m),
                  .depth_weight = static_cast<float>(config_.depth_weight),
                  .typical_depth_m = static_cast<float>(set_.typical_depth_m),
                  .confident_px = static_cast<float>(config_.confident_px),
                  .centre_W = Eigen::Vector3f::Zero(),
                  .scale_m = static_cast<float>(head_.scale_m)};
}

Result<void> CheckSet(const TrainingSet& set, const HeadTrainerConfig& config) {
  if (set.dimension != config.shape.inputs) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format(
            "head.inputs is {}, must be {} as the features'", config.shape.inputs, set.dimension)};
  }
  if (set.targets.size() < static_cast<std::size_t>(config.batch)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("there are {} training cells, must be at least a batch of {}",
                             set.targets.size(),
                             config.batch)};
  }
  return {};
}

template <typename Number>
Result<Head> RunTrainer(const TrainingSet& set,
                        const HeadTrainerConfig& config,
                        Precision precision,
                        const TrainerHooks& hooks) {
  Trainer<Number> trainer(set, config, precision, hooks);
  if (hooks.resume != nullptr) {
    if (auto resumed = trainer.Resume(*hooks.resume); !resumed) return std::move(resumed).error();
  }
  return trainer.Run();
}

}  // namespace

Result<void> HeadTrainerConfig::Validate() const {
  if (auto valid = shape.Validate(); !valid) return valid;
  using Rule = std::tuple<const char*, double, double, double>;
  for (const auto& [field, value, low, high] :
       {Rule{"iterations", iterations, 1, 1e7},
        Rule{"batch", batch, kTrainerShards, 1 << 20},
        Rule{"learning_rate", learning_rate, 1e-8, 1.0},
        Rule{"matrix_learning_rate", matrix_learning_rate, 1e-8, 1.0},
        Rule{"warm_up", warm_up, 1e-6, 0.999},
        Rule{"weight_decay", weight_decay, 0.0, 1.0},
        Rule{"initial_tolerance_px", initial_tolerance_px, 1e-3, 1e4},
        Rule{"final_tolerance_px", final_tolerance_px, 1e-3, initial_tolerance_px},
        Rule{"depth_baseline_m", depth_baseline_m, 0.0, 1e3},
        Rule{"depth_weight", depth_weight, 0.0, 1e3},
        Rule{"confident_px", confident_px, 1e-3, 1e4},
        Rule{"threads", threads, 1, 256}}) {
    if (!(value >= low && value <= high)) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("training.{} is {}, must be in [{}, {}]", field, value, low, high)};
    }
  }
  if (batch % kTrainerShards != 0) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("training.batch is {}, must be a multiple of {}", batch, kTrainerShards)};
  }
  return {};
}

Result<Head> TrainHead(const TrainingSet& set,
                       const HeadTrainerConfig& config,
                       const TrainerHooks& hooks) {
  if (auto valid = config.Validate(); !valid) return std::move(valid).error();
  if (auto valid = CheckSet(set, config); !valid) return std::move(valid).error();
  const Precision precision =
      config.precision == Precision::kFastest ? FastestPrecision() : config.precision;
  try {
    omp_set_num_threads(1);  // products are made for one thread each
    if (precision == Precision::kBfloat16)
      return RunTrainer<Bfloat16>(set, config, precision, hooks);
    return RunTrainer<float>(set, config, precision, hooks);
  } catch (const dnnl::error& error) {
    return Error{ErrorKind::kInternal, fmt::format("training a head: {}", error.what())};
  }
}

}  // namespace relocd
