#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/result.h"
#include "scene_coordinates/head.h"
#include "scene_coordinates/onednn_head.h"
#include "scene_coordinates/training_set.h"

namespace relocd {

/// How a head is trained. Errors are in working pixels.
struct HeadTrainerConfig {
  HeadShape shape;
  int iterations = 3000;
  int batch = 4096;                    ///< A multiple of kTrainerShards.
  double matrix_learning_rate = 0.02;  ///< Of hidden layers; the highest of the one cycle.
  double learning_rate = 6e-3;         ///< Of biases and the last layer, likewise.
  double warm_up = 0.1;                ///< Share of the iterations until it is reached.
  double weight_decay = 0.01;
  double initial_tolerance_px = 50.0;  ///< Larger errors hardly pull, at the beginning,
  double final_tolerance_px = 1.5;     ///< and at the end.
  double depth_baseline_m = 2.0;       ///< Depth errors count as the disparity they make over this.
  double depth_weight = 1.0;
  double confident_px = 4.0;  ///< Points with less error than this are called right.
  std::uint64_t seed = 1;
  int threads = 1;  ///< The result does not depend on it.
  Precision precision = Precision::kFastest;

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// A batch is divided into this many parts, whose gradients are summed in order, so that the result
/// is the same for any number of threads.
inline constexpr int kTrainerShards = 4;

/// How training goes, over the iterations since the last report.
struct TrainingProgress {
  int iteration = 0;
  int iterations = 0;
  double loss = 0.0;
  double median_error_px = 0.0;  ///< Reprojection of the last batch's valid points.
  double valid = 0.0;            ///< Share of points in front of the camera and roughly right.
};

/// Where a training stands. With it, the same set and the same configuration, training goes on to
/// the same bits as without a break.
struct TrainerState {
  int iteration = 0;              ///< Steps done.
  std::vector<float> parameters;  ///< Of all layers, as the next two, which are the optimizer's.
  std::vector<float> momentum;
  std::vector<float> variance;
};

/// What happens while a head is trained. All are called by one thread, while the others wait.
struct TrainerHooks {
  std::function<void(const TrainingProgress&)> progress = {};
  /// Gets the state, and the head as it is then, every `state_every` iterations; 0 is never.
  std::function<void(const TrainerState&, const Head&)> state = {};
  int state_every = 0;
  const TrainerState* resume = nullptr;  ///< Begin there. Borrowed during the call.
};

/// Trains a head to give for each cell the point that it looks at.
///
/// Follows the published idea of scene-coordinate regression on a shuffled buffer of frozen
/// features (Brachmann et al., "Accelerated Coordinate Encoding", 2023, and "DSAC*", 2021): L1
/// reprojection error, squashed by a logarithm and later by a tanh, whose width shrinks during
/// training, and for points that are behind the camera or far off the distance to a point at the
/// known or typical depth. Where a depth was measured, its error counts too, as disparity.
///
/// The network and its derivatives are written out here; oneDNN multiplies the matrices.
/// @return kInvalidInput for a bad configuration, an empty set, or a state of another training.
Result<Head> TrainHead(const TrainingSet& set,
                       const HeadTrainerConfig& config,
                       const TrainerHooks& hooks);

}  // namespace relocd
