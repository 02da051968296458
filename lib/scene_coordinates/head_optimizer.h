#pragma once

#include <memory>
#include <span>
#include <vector>

#include "scene_coordinates/onednn_head.h"
#include "scene_coordinates/shard_network.h"

namespace relocd {

/// How far an iteration moves the parameters.
struct OptimizerStep {
  int iteration = 0;         ///< 0, 1, 2, ...
  double matrix_rate = 0.0;  ///< Of the hidden layers' weights.
  double rate = 0.0;         ///< Of the biases and the last layer's weights.
  double weight_decay = 0.0;
};

/// Moves a head's parameters along the gradient.
///
/// The weights of hidden layers by Muon (Jordan et al., "Muon: an optimizer for hidden layers in
/// neural networks", 2024): the momentum's matrix is brought near to an orthogonal one by
/// Newton-Schulz iterations, so that all its directions are learned at one speed; the rest by AdamW
/// (Loshchilov and Hutter, "Decoupled weight decay regularization", 2019). To the same error, this
/// takes about half of the iterations that AdamW alone takes.
class HeadOptimizer {
 public:
  /// @param precision  of the matrix products; not kFastest. Throws dnnl::error when oneDNN has no
  ///                   implementation for this CPU.
  HeadOptimizer(const ParameterLayout& layout, Precision precision);
  ~HeadOptimizer();
  HeadOptimizer(const HeadOptimizer&) = delete;
  HeadOptimizer& operator=(const HeadOptimizer&) = delete;
  HeadOptimizer(HeadOptimizer&&) = delete;
  HeadOptimizer& operator=(HeadOptimizer&&) = delete;

  /// Moves one layer. Different layers may be moved by different threads at the same time.
  /// @param gradient, parameters  of all layers.
  void UpdateLayer(int layer,
                   const OptimizerStep& step,
                   std::span<const float> gradient,
                   std::span<float> parameters);

  /// All that it remembers between steps, one value a parameter.
  [[nodiscard]] const std::vector<float>& momentum() const { return momentum_; }
  [[nodiscard]] const std::vector<float>& variance() const { return variance_; }
  /// Goes on as one that remembered this. Both must be of the layout's size.
  void Restore(const std::vector<float>& momentum, const std::vector<float>& variance) {
    momentum_ = momentum;
    variance_ = variance;
  }

 private:
  class Orthogonaliser;

  ParameterLayout layout_;
  std::vector<float> momentum_;
  std::vector<float> variance_;                                   ///< AdamW's alone.
  std::vector<std::unique_ptr<Orthogonaliser>> orthogonalisers_;  ///< One a hidden layer.
};

}  // namespace relocd
