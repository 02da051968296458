#include "scene_coordinates/shard_network.h"

#include <algorithm>
#include <type_traits>
#include <unordered_map>

#include <oneapi/dnnl/dnnl.hpp>

#include "core/check.h"

#define RELOCD_VECTORISED __attribute__((target_clones("default", "arch=x86-64-v3")))

namespace relocd {
namespace {

using dnnl::memory;

template <typename Number>
constexpr memory::data_type DataType() {
  return std::is_same_v<Number, float> ? memory::data_type::f32 : memory::data_type::bf16;
}

/// The last layer's outputs, padded to a vector register.
constexpr std::size_t kLanes = 8;
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float)), aligned(4), may_alias));
static_assert(kHeadOutputs <= kLanes);

/// out (rows x kLanes) = hidden (rows x width) * weights (width x kLanes) + bias (kLanes).
template <typename Number>
[[gnu::always_inline]] inline void MultiplyLanes(
    const Number* hidden, std::size_t width, const float* weights, const float* bias, float* out) {
  Lanes sum = *reinterpret_cast<const Lanes*>(bias);
  for (std::size_t i = 0; i < width; ++i) {
    sum += *reinterpret_cast<const Lanes*>(weights + i * kLanes) * ToFloat(hidden[i]);
  }
  *reinterpret_cast<Lanes*>(out) = sum;
}

/// gradient (width x kLanes) += hidden^T * delta for one row.
template <typename Number>
[[gnu::always_inline]] inline void AddOuterProduct(const Number* hidden,
                                                   std::size_t width,
                                                   const float* delta,
                                                   float* gradient) {
  const Lanes d = *reinterpret_cast<const Lanes*>(delta);
  for (std::size_t i = 0; i < width; ++i) {
    *reinterpret_cast<Lanes*>(gradient + i * kLanes) += d * ToFloat(hidden[i]);
  }
}

template <typename Number>
[[gnu::always_inline]] inline Number Narrow(float value) {
  if constexpr (std::is_same_v<Number, float>) {
    return value;
  } else {
    return ToBfloat16(value);
  }
}

/// One row of delta = (output delta * weights^T), where hidden is positive; its sum into `sums`.
template <typename Number>
[[gnu::always_inline]] inline void OutputDeltaRow(const float* output_delta,
                                                  const float* weights_transposed,
                                                  const Number* hidden,
                                                  std::size_t width,
                                                  Number* delta) {
  for (std::size_t i = 0; i < width; ++i) {
    float sum = 0.0F;
    for (std::size_t output = 0; output < kHeadOutputs; ++output) {
      sum += output_delta[output] * weights_transposed[output * width + i];
    }
    delta[i] = Narrow<Number>(ToFloat(hidden[i]) > 0.0F ? sum : 0.0F);
  }
}

/// Clears delta where hidden is not positive (relu's derivative), and adds the row to the sums.
template <typename Number>
[[gnu::always_inline]] inline void MaskRow(const Number* hidden,
                                           std::size_t width,
                                           Number* delta,
                                           float* sums) {
  for (std::size_t i = 0; i < width; ++i) {
    const float value = ToFloat(hidden[i]) > 0.0F ? ToFloat(delta[i]) : 0.0F;
    delta[i] = Narrow<Number>(value);
    sums[i] += value;
  }
}

// Function multi-versioning does not go with templates, hence one of each for both types.
// NOLINTBEGIN(bugprone-macro-parentheses): the argument is a type, which takes no parentheses.
#define RELOCD_DEFINE_ROW_LOOPS(Number)                                                         \
  RELOCD_VECTORISED void MultiplyRows(const Number* hidden,                                     \
                                      std::size_t rows,                                         \
                                      std::size_t width,                                        \
                                      const float* weights_and_bias,                            \
                                      float* out) {                                             \
    for (std::size_t row = 0; row < rows; ++row) {                                              \
      MultiplyLanes(hidden + row * width,                                                       \
                    width,                                                                      \
                    weights_and_bias,                                                           \
                    weights_and_bias + width * kLanes,                                          \
                    out + row * kLanes);                                                        \
    }                                                                                           \
  }                                                                                             \
  RELOCD_VECTORISED void AddOuterProducts(const Number* hidden,                                 \
                                          std::size_t rows,                                     \
                                          std::size_t width,                                    \
                                          const float* deltas,                                  \
                                          float* gradient) {                                    \
    for (std::size_t row = 0; row < rows; ++row) {                                              \
      AddOuterProduct(hidden + row * width, width, deltas + row * kLanes, gradient);            \
    }                                                                                           \
  }                                                                                             \
  RELOCD_VECTORISED void OutputDeltas(const float* output_deltas,                               \
                                      const float* weights_transposed,                          \
                                      const std::vector<Number>& hidden,                        \
                                      std::size_t width,                                        \
                                      Number* deltas) {                                         \
    for (std::size_t row = 0; row < hidden.size() / width; ++row) {                             \
      OutputDeltaRow(output_deltas + row * kLanes,                                              \
                     weights_transposed,                                                        \
                     hidden.data() + row * width,                                               \
                     width,                                                                     \
                     deltas + row * width);                                                     \
    }                                                                                           \
  }                                                                                             \
  RELOCD_VECTORISED void MaskRows(                                                              \
      const Number* hidden, std::size_t rows, std::size_t width, Number* deltas, float* sums) { \
    std::fill_n(sums, width, 0.0F);                                                             \
    for (std::size_t row = 0; row < rows; ++row) {                                              \
      MaskRow(hidden + row * width, width, deltas + row * width, sums);                         \
    }                                                                                           \
  }

RELOCD_DEFINE_ROW_LOOPS(float)
RELOCD_DEFINE_ROW_LOOPS(Bfloat16)
#undef RELOCD_DEFINE_ROW_LOOPS
// NOLINTEND(bugprone-macro-parentheses)

}  // namespace

ParameterLayout::ParameterLayout(const HeadShape& shape) : shape_(shape) {
  for (int layer = 0; layer < shape.layer_count(); ++layer) {
    begins_.push_back(size_);
    size_ += static_cast<std::size_t>(shape.LayerInputs(layer) + 1) *
             static_cast<std::size_t>(shape.LayerOutputs(layer));
  }
}

std::size_t ParameterLayout::BiasBegin(int layer) const {
  return WeightsBegin(layer) + static_cast<std::size_t>(shape_.LayerInputs(layer)) *
                                   static_cast<std::size_t>(shape_.LayerOutputs(layer));
}

std::vector<float> FlattenHead(const Head& head, const ParameterLayout& layout) {
  std::vector<float> parameters;
  parameters.reserve(layout.size());
  for (const HeadLayer& layer : head.layers) {
    parameters.insert(parameters.end(), layer.weights.begin(), layer.weights.end());
    parameters.insert(parameters.end(), layer.bias.begin(), layer.bias.end());
  }
  RELOCD_CHECK(parameters.size() == layout.size(), "the head has another shape");
  return parameters;
}

void UnflattenHead(const ParameterLayout& layout, std::span<const float> parameters, Head& head) {
  head.shape = layout.shape();
  head.layers.clear();
  for (int index = 0; index < layout.shape().layer_count(); ++index) {
    HeadLayer layer;
    layer.inputs = layout.shape().LayerInputs(index);
    layer.outputs = layout.shape().LayerOutputs(index);
    const auto weights = parameters.subspan(layout.WeightsBegin(index));
    const auto weight_count =
        static_cast<std::size_t>(layer.inputs) * static_cast<std::size_t>(layer.outputs);
    layer.weights.assign(weights.begin(),
                         weights.begin() + static_cast<std::ptrdiff_t>(weight_count));
    const auto bias = parameters.subspan(layout.BiasBegin(index));
    layer.bias.assign(bias.begin(), bias.begin() + layer.outputs);
    head.layers.push_back(std::move(layer));
  }
}

/// Where one layer's numbers are.
template <typename Number>
struct ShardNetwork<Number>::LayerMemory {
  int layer = 0;
  std::size_t rows = 0;
  const Number* in = nullptr;
  const Number* weights = nullptr;
  const float* bias = nullptr;
  const Number* out = nullptr;
};

/// oneDNN's matrix products, one per layer and purpose.
template <typename Number>
struct ShardNetwork<Number>::Products {
  struct Product {
    dnnl::matmul matmul;
    std::unordered_map<int, memory> arguments;
  };

  dnnl::engine engine{dnnl::engine::kind::cpu, 0};
  dnnl::stream stream{engine};
  std::vector<Product> forward;
  std::vector<Product> weight_gradients;
  std::vector<Product> backward;  ///< From a layer's delta to that of its input.

  [[nodiscard]] memory Wrap(const memory::desc& desc, const void* data) const {
    return {desc, engine, const_cast<void*>(data)};  // oneDNN does not write to sources
  }
  [[nodiscard]] static memory::desc Rows(std::size_t rows,
                                         int columns,
                                         memory::data_type type = DataType<Number>()) {
    return {{static_cast<memory::dim>(rows), columns}, type, memory::format_tag::ab};
  }
  [[nodiscard]] static memory::desc Transposed(int rows, std::size_t columns) {
    return {{rows, static_cast<memory::dim>(columns)}, DataType<Number>(), memory::format_tag::ba};
  }
  void Run(const Product& product) { product.matmul.execute(stream, product.arguments); }

  void AddForward(const HeadShape& shape, const LayerMemory& at);
  void AddWeightGradient(const HeadShape& shape, const LayerMemory& at);
  void AddBackward(const HeadShape& shape, const LayerMemory& at);
};

template <typename Number>
void ShardNetwork<Number>::Products::AddForward(const HeadShape& shape, const LayerMemory& at) {
  dnnl::post_ops relu;
  if (shape.EndsBlock(at.layer)) relu.append_sum(1.0F);
  relu.append_eltwise(1.0F, dnnl::algorithm::eltwise_relu, 0.0F, 0.0F);
  dnnl::primitive_attr attributes;
  attributes.set_post_ops(relu);
  const int inputs = shape.LayerInputs(at.layer);
  const auto in_desc = Rows(at.rows, inputs);
  const auto out_desc = Rows(at.rows, shape.width);
  const auto weights_desc = Rows(static_cast<std::size_t>(inputs), shape.width);
  const auto bias_desc = Rows(1, shape.width, memory::data_type::f32);
  const dnnl::matmul::primitive_desc description(
      {in_desc, weights_desc, bias_desc, out_desc}, attributes, engine);
  forward.push_back({dnnl::matmul(description),
                     {{DNNL_ARG_SRC, Wrap(in_desc, at.in)},
                      {DNNL_ARG_WEIGHTS, Wrap(weights_desc, at.weights)},
                      {DNNL_ARG_BIAS, Wrap(bias_desc, at.bias)},
                      {DNNL_ARG_DST, Wrap(out_desc, at.out)}}});
}

template <typename Number>
void ShardNetwork<Number>::Products::AddWeightGradient(const HeadShape& shape,
                                                       const LayerMemory& at) {
  const int inputs = shape.LayerInputs(at.layer);
  const auto in_transposed = Transposed(inputs, at.rows);
  const auto delta_desc = Rows(at.rows, shape.width);
  const auto gradient_desc =
      Rows(static_cast<std::size_t>(inputs), shape.width, memory::data_type::f32);
  const dnnl::matmul::primitive_desc description({in_transposed, delta_desc, gradient_desc},
                                                 engine);
  weight_gradients.push_back({dnnl::matmul(description),
                              {{DNNL_ARG_SRC, Wrap(in_transposed, at.in)},
                               {DNNL_ARG_WEIGHTS, Wrap(delta_desc, nullptr)},
                               {DNNL_ARG_DST, Wrap(gradient_desc, nullptr)}}});
}

template <typename Number>
void ShardNetwork<Number>::Products::AddBackward(const HeadShape& shape, const LayerMemory& at) {
  if (at.layer == 0) {  // nothing is behind the features
    backward.emplace_back();
    return;
  }
  const bool begins_block = shape.EndsBlock(at.layer + 2);
  dnnl::post_ops add_skip;
  if (begins_block) add_skip.append_sum(1.0F);
  dnnl::primitive_attr attributes;
  attributes.set_post_ops(add_skip);
  const auto delta_desc = Rows(at.rows, shape.width);
  const auto weights_transposed = Transposed(shape.width, static_cast<std::size_t>(shape.width));
  const dnnl::matmul::primitive_desc description(
      {delta_desc, weights_transposed, delta_desc}, attributes, engine);
  backward.push_back({dnnl::matmul(description),
                      {{DNNL_ARG_SRC, Wrap(delta_desc, nullptr)},
                       {DNNL_ARG_WEIGHTS, Wrap(weights_transposed, at.weights)},
                       {DNNL_ARG_DST, Wrap(delta_desc, nullptr)}}});
}

template <typename Number>
ShardNetwork<Number>::ShardNetwork(const ParameterLayout& layout,
                                   std::size_t rows,
                                   const float* parameters,
                                   const Number* narrow_parameters)
    : layout_(layout),
      rows_(rows),
      parameters_(parameters),
      products_(std::make_unique<Products>()) {
  const HeadShape& shape = layout.shape();
  const auto width = static_cast<std::size_t>(shape.width);
  inputs_.resize(rows * static_cast<std::size_t>(shape.inputs));
  hidden_.assign(static_cast<std::size_t>(shape.layer_count() - 1),
                 std::vector<Number>(rows * width));
  deltas_.assign(3, std::vector<Number>(rows * width));
  outputs_.resize(rows * kLanes);
  output_gradients_.resize(rows * kLanes);
  output_weights_.resize((width + 1) * kLanes);

  for (int layer = 0; layer + 1 < shape.layer_count(); ++layer) {
    const auto index = static_cast<std::size_t>(layer);
    const LayerMemory memory{layer,
                             rows,
                             layer == 0 ? inputs_.data() : hidden_[index - 1].data(),
                             narrow_parameters + layout.WeightsBegin(layer),
                             parameters + layout.BiasBegin(layer),
                             hidden_[index].data()};
    products_->AddForward(shape, memory);
    products_->AddWeightGradient(shape, memory);
    products_->AddBackward(shape, memory);
  }
}

template <typename Number>
ShardNetwork<Number>::~ShardNetwork() = default;

template <typename Number>
std::span<Number> ShardNetwork<Number>::InputRow(std::size_t row) {
  const auto inputs = static_cast<std::size_t>(layout_.shape().inputs);
  return std::span(inputs_).subspan(row * inputs, inputs);
}

template <typename Number>
void ShardNetwork<Number>::Run(OutputLoss& loss, std::span<float> gradient) {
  RELOCD_CHECK(gradient.size() == layout_.size(), "gradient must have the parameters' size");
  Forward();
  OutputForward();
  // The loss sees rows of kHeadOutputs; here they are padded.
  std::vector<float>& padded = outputs_;
  for (std::size_t row = 0; row < rows_; ++row) {
    std::copy_n(padded.begin() + static_cast<std::ptrdiff_t>(row * kLanes),
                kHeadOutputs,
                padded.begin() + static_cast<std::ptrdiff_t>(row * kHeadOutputs));
  }
  const std::span<const float> points = outputs_;
  const std::span<float> gradients = output_gradients_;
  loss.Evaluate(points.first(rows_ * kHeadOutputs), gradients.first(rows_ * kHeadOutputs));
  for (std::size_t row = rows_; row-- > 0;) {
    float* lanes = output_gradients_.data() + row * kLanes;
    std::copy_backward(
        output_gradients_.begin() + static_cast<std::ptrdiff_t>(row * kHeadOutputs),
        output_gradients_.begin() + static_cast<std::ptrdiff_t>((row + 1) * kHeadOutputs),
        output_gradients_.begin() + static_cast<std::ptrdiff_t>(row * kLanes + kHeadOutputs));
    std::fill(lanes + kHeadOutputs, lanes + kLanes, 0.0F);
  }
  OutputBackward(gradient);
  Backward(gradient);
}

template <typename Number>
void ShardNetwork<Number>::Forward() {
  const HeadShape& shape = layout_.shape();
  for (int layer = 0; layer + 1 < shape.layer_count(); ++layer) {
    const auto index = static_cast<std::size_t>(layer);
    // The sum of a block starts from the block's input, which lies three layers before its end.
    if (shape.EndsBlock(layer)) hidden_[index] = hidden_[index - 3];
    products_->Run(products_->forward[index]);
  }
  products_->stream.wait();
}

template <typename Number>
void ShardNetwork<Number>::OutputForward() {
  const auto width = static_cast<std::size_t>(layout_.shape().width);
  const int last = layout_.shape().layer_count() - 1;
  const float* weights = parameters_ + layout_.WeightsBegin(last);
  for (std::size_t row = 0; row <= width; ++row) {  // the bias is the row after the last
    std::copy_n(weights + row * kHeadOutputs, kHeadOutputs, output_weights_.data() + row * kLanes);
  }
  MultiplyRows(hidden_.back().data(), rows_, width, output_weights_.data(), outputs_.data());
}

template <typename Number>
void ShardNetwork<Number>::OutputBackward(std::span<float> gradient) {
  const auto width = static_cast<std::size_t>(layout_.shape().width);
  const int last = layout_.shape().layer_count() - 1;
  std::vector<float>& padded_gradient = output_weights_;  // of the same shape, and done with
  std::fill(padded_gradient.begin(), padded_gradient.end(), 0.0F);
  AddOuterProducts(
      hidden_.back().data(), rows_, width, output_gradients_.data(), padded_gradient.data());
  float* bias_gradient = padded_gradient.data() + width * kLanes;
  for (std::size_t i = 0; i < rows_ * kLanes; ++i) {
    bias_gradient[i % kLanes] += output_gradients_[i];
  }
  for (std::size_t row = 0; row <= width; ++row) {
    std::copy_n(padded_gradient.data() + row * kLanes,
                kHeadOutputs,
                gradient.data() + layout_.WeightsBegin(last) + row * kHeadOutputs);
  }
  std::vector<float>& transposed = output_weights_;
  const float* weights = parameters_ + layout_.WeightsBegin(last);
  for (std::size_t row = 0; row < width; ++row) {
    for (std::size_t output = 0; output < kHeadOutputs; ++output) {
      transposed[output * width + row] = weights[row * kHeadOutputs + output];
    }
  }
  OutputDeltas(
      output_gradients_.data(), transposed.data(), hidden_.back(), width, deltas_[0].data());
}

template <typename Number>
void ShardNetwork<Number>::Backward(std::span<float> gradient) {
  const HeadShape& shape = layout_.shape();
  const auto width = static_cast<std::size_t>(shape.width);
  std::size_t current = 0;
  for (int layer = shape.layer_count() - 2; layer >= 0; --layer) {
    const auto index = static_cast<std::size_t>(layer);
    // Clears what relu let not pass; the last hidden layer's was cleared when it was made, and
    // clearing twice changes nothing.
    MaskRows(hidden_[index].data(),
             rows_,
             width,
             deltas_[current].data(),
             gradient.data() + layout_.BiasBegin(layer));
    auto& weight_gradient = products_->weight_gradients[index];
    weight_gradient.arguments[DNNL_ARG_WEIGHTS].set_data_handle(deltas_[current].data());
    weight_gradient.arguments[DNNL_ARG_DST].set_data_handle(gradient.data() +
                                                            layout_.WeightsBegin(layer));
    products_->Run(weight_gradient);
    if (layer == 0) break;
    // Within a block the three buffers go round once: the block's end, middle, and back onto the
    // end, whose delta also passes to the block's input unchanged.
    const std::size_t next = (current + 1) % deltas_.size();
    auto& backward = products_->backward[index];
    backward.arguments[DNNL_ARG_SRC].set_data_handle(deltas_[current].data());
    backward.arguments[DNNL_ARG_DST].set_data_handle(deltas_[next].data());
    products_->Run(backward);
    products_->stream.wait();
    current = next;
  }
  products_->stream.wait();
}

template class ShardNetwork<float>;
template class ShardNetwork<Bfloat16>;

}  // namespace relocd
