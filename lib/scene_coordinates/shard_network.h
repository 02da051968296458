#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "scene_coordinates/bfloat16.h"
#include "scene_coordinates/head.h"

namespace relocd {

/// Where each layer's numbers are in one flat array of parameters, or of their gradients.
class ParameterLayout {
 public:
  explicit ParameterLayout(const HeadShape& shape);

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t WeightsBegin(int layer) const {
    return begins_[static_cast<std::size_t>(layer)];
  }
  /// Biases follow the weights.
  [[nodiscard]] std::size_t BiasBegin(int layer) const;
  [[nodiscard]] const HeadShape& shape() const { return shape_; }

 private:
  HeadShape shape_;
  std::vector<std::size_t> begins_;
  std::size_t size_ = 0;
};

std::vector<float> FlattenHead(const Head& head, const ParameterLayout& layout);
/// The head's layers are replaced.
void UnflattenHead(const ParameterLayout& layout, std::span<const float> parameters, Head& head);

/// The derivatives that a network needs from outside: given the outputs (rows x kHeadOutputs),
/// writes d loss / d output into `gradients` of the same shape.
class OutputLoss {
 public:
  OutputLoss() = default;
  OutputLoss(const OutputLoss&) = delete;
  OutputLoss& operator=(const OutputLoss&) = delete;
  OutputLoss(OutputLoss&&) = delete;
  OutputLoss& operator=(OutputLoss&&) = delete;
  virtual ~OutputLoss() = default;
  virtual void Evaluate(std::span<const float> outputs, std::span<float> gradients) = 0;
};

/// A head's network over a fixed number of rows, forward and backward. `Number` (float or
/// Bfloat16) is the type of weights and hidden values in the matrix products; sums, gradients of
/// the weights and the last layer are in float.
///
/// Thread-bound; each thread has its own, and all may share the parameters.
template <typename Number>
class ShardNetwork {
 public:
  /// Borrows the parameters in both precisions, which must outlive it and stay where they are.
  /// Throws dnnl::error when oneDNN has no implementation for this CPU.
  ShardNetwork(const ParameterLayout& layout,
               std::size_t rows,
               const float* parameters,
               const Number* narrow_parameters);
  ~ShardNetwork();
  ShardNetwork(const ShardNetwork&) = delete;
  ShardNetwork& operator=(const ShardNetwork&) = delete;
  ShardNetwork(ShardNetwork&&) = delete;
  ShardNetwork& operator=(ShardNetwork&&) = delete;

  /// Where the features of row r go: layout's shape.inputs values.
  [[nodiscard]] std::span<Number> InputRow(std::size_t row);

  /// Runs forward, asks `loss`, runs backward. `gradient` (layout.size()) is overwritten with the
  /// sum over the rows.
  void Run(OutputLoss& loss, std::span<float> gradient);

 private:
  struct LayerMemory;
  struct Products;

  void Forward();
  void OutputForward();
  void OutputBackward(std::span<float> gradient);
  void Backward(std::span<float> gradient);

  ParameterLayout layout_;
  std::size_t rows_;
  const float* parameters_;
  std::vector<Number> inputs_;
  std::vector<std::vector<Number>> hidden_;  ///< Of each layer but the last, after relu.
  std::vector<std::vector<Number>> deltas_;  ///< d loss / d (sum of a layer): three, in turns.
  std::vector<float> outputs_;
  std::vector<float> output_gradients_;
  std::vector<float> output_weights_;  ///< Transposed and not: see OutputForward.
  std::unique_ptr<Products> products_;
};

extern template class ShardNetwork<float>;
extern template class ShardNetwork<Bfloat16>;

}  // namespace relocd
