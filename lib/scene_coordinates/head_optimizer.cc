#include "scene_coordinates/head_optimizer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <unordered_map>
#include <utility>

#include <oneapi/dnnl/dnnl.hpp>

#include "scene_coordinates/bfloat16.h"

#define RELOCD_VECTORISED __attribute__((target_clones("default", "arch=x86-64-v3")))

namespace relocd {
namespace {

using dnnl::memory;

constexpr float kMomentum = 0.9F;
constexpr float kVarianceMomentum = 0.999F;
constexpr float kAdamEpsilon = 1e-8F;
constexpr float kMatrixMomentum = 0.95F;

/// Factors of AdamW for one step.
struct AdamStep {
  float rate = 0.0F;
  float decay = 0.0F;
  float momentum_correction = 0.0F;
  float variance_correction = 0.0F;
};

AdamStep MakeAdamStep(const OptimizerStep& step) {
  const int steps = step.iteration + 1;
  return {
      .rate = static_cast<float>(step.rate),
      .decay = static_cast<float>(step.rate * step.weight_decay),
      .momentum_correction = static_cast<float>(1.0 / (1.0 - std::pow(kMomentum, steps))),
      .variance_correction = static_cast<float>(1.0 / (1.0 - std::pow(kVarianceMomentum, steps)))};
}

/// A range of parameters and all that belongs to it.
struct AdamRange {
  std::size_t size = 0;
  float* parameters = nullptr;
  float* momentum = nullptr;
  float* variance = nullptr;
  const float* gradient = nullptr;
};

RELOCD_VECTORISED void UpdateByAdam(const AdamStep& step, const AdamRange& range) {
  for (std::size_t i = 0; i < range.size; ++i) {
    const float gradient = range.gradient[i];
    range.momentum[i] = kMomentum * range.momentum[i] + (1.0F - kMomentum) * gradient;
    range.variance[i] =
        kVarianceMomentum * range.variance[i] + (1.0F - kVarianceMomentum) * gradient * gradient;
    const float deviation = std::sqrt(range.variance[i] * step.variance_correction) + kAdamEpsilon;
    range.parameters[i] -= step.rate * range.momentum[i] * step.momentum_correction / deviation +
                           step.decay * range.parameters[i];
  }
}

/// Adds the gradient to the momentum, and looks one step ahead of it (Nesterov).
/// @return the sum of the direction's squares.
RELOCD_VECTORISED float AddMomentum(const float* gradient,
                                    std::size_t size,
                                    float* momentum,
                                    float* direction) {
  float squares = 0.0F;
  for (std::size_t i = 0; i < size; ++i) {
    momentum[i] = kMatrixMomentum * momentum[i] + gradient[i];
    direction[i] = gradient[i] + kMatrixMomentum * momentum[i];
    squares += direction[i] * direction[i];
  }
  return squares;
}

RELOCD_VECTORISED void MoveAgainst(
    const float* direction, std::size_t size, float rate, float keep, float* parameters) {
  for (std::size_t i = 0; i < size; ++i) {
    parameters[i] = keep * parameters[i] - rate * direction[i];
  }
}

RELOCD_VECTORISED void Convert(const float* in, std::size_t size, Bfloat16* out) {
  for (std::size_t i = 0; i < size; ++i) {
    out[i] = ToBfloat16(in[i]);
  }
}

void Transpose(const float* in, int rows, int columns, float* out) {
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      out[static_cast<std::ptrdiff_t>(column) * rows + row] =
          in[static_cast<std::ptrdiff_t>(row) * columns + column];
    }
  }
}

}  // namespace

/// Brings a matrix near to the orthogonal one that is nearest to it: keeps its singular vectors and
/// brings its singular values, of which none may exceed one, to between 0.7 and 1.2.
///
/// X <- a X + (b A + c A A) X with A = X X^T, five times; the coefficients are Muon's, chosen for
/// speed where small singular values are.
class HeadOptimizer::Orthogonaliser {
 public:
  Orthogonaliser(int rows, int columns, Precision precision)
      : rows_(rows),
        columns_(columns),
        short_(std::min(rows, columns)),
        long_(std::max(rows, columns)),
        type_(precision == Precision::kBfloat16 ? memory::data_type::bf16
                                                : memory::data_type::f32) {
    const auto wide = Desc(short_, long_, memory::data_type::f32);
    const auto square = Desc(short_, short_, memory::data_type::f32);
    x_ = memory(wide, engine_);
    a_ = memory(square, engine_);
    b_ = memory(square, engine_);
    narrow_x_ = memory(Desc(short_, long_, type_), engine_);
    narrow_a_ = memory(Desc(short_, short_, type_), engine_);
    narrow_b_ = memory(Desc(short_, short_, type_), engine_);
    const memory transposed_x(
        {{long_, short_}, type_, memory::format_tag::ba}, engine_, narrow_x_.get_data_handle());
    gram_ = Make(narrow_x_, transposed_x, a_, 1.0F, 0.0F);
    square_ = Make(narrow_a_, narrow_a_, b_, kC, kB);
    product_ = Make(narrow_b_, narrow_x_, x_, 1.0F, kA);
    scratch_.resize(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns));
  }

  /// rows x columns values, to be filled before Run and read after it.
  [[nodiscard]] std::vector<float>& matrix() { return scratch_; }

  /// @param norm  of the matrix, by which it is divided first.
  void Run(float norm) {
    const float scale = 1.0F / norm;
    for (float& value : scratch_) {
      value *= scale;
    }
    auto* x = static_cast<float*>(x_.get_data_handle());
    if (rows_ > columns_) {
      Transpose(scratch_.data(), rows_, columns_, x);
    } else {
      std::copy(scratch_.begin(), scratch_.end(), x);
    }
    constexpr int kIterations = 5;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      Narrow(x_, narrow_x_);
      Execute(gram_);
      Narrow(a_, narrow_a_);
      std::copy_n(static_cast<const float*>(a_.get_data_handle()),
                  a_.get_desc().get_size() / sizeof(float),
                  static_cast<float*>(b_.get_data_handle()));
      Execute(square_);
      Narrow(b_, narrow_b_);
      Execute(product_);
    }
    if (rows_ > columns_) {
      Transpose(x, columns_, rows_, scratch_.data());
    } else {
      std::copy_n(x, scratch_.size(), scratch_.begin());
    }
  }

 private:
  static constexpr float kA = 3.4445F;
  static constexpr float kB = -4.7750F;
  static constexpr float kC = 2.0315F;

  struct Product {
    dnnl::matmul matmul;
    std::unordered_map<int, memory> arguments;
  };

  static memory::desc Desc(int rows, int columns, memory::data_type type) {
    return {{rows, columns}, type, memory::format_tag::ab};
  }

  /// out = scale * left * right + keep * out
  Product Make(
      const memory& left, const memory& right, const memory& out, float scale, float keep) const {
    dnnl::primitive_attr attributes;
    attributes.set_output_scales(0, {scale});
    if (keep != 0.0F) {
      dnnl::post_ops sum;
      sum.append_sum(keep);
      attributes.set_post_ops(sum);
    }
    const dnnl::matmul::primitive_desc description(
        {left.get_desc(), right.get_desc(), out.get_desc()}, attributes, engine_);
    return {dnnl::matmul(description),
            {{DNNL_ARG_SRC, left}, {DNNL_ARG_WEIGHTS, right}, {DNNL_ARG_DST, out}}};
  }

  void Narrow(const memory& from, const memory& to) const {
    const std::size_t size = from.get_desc().get_size() / sizeof(float);
    const auto* values = static_cast<const float*>(from.get_data_handle());
    if (type_ == memory::data_type::bf16) {
      Convert(values, size, static_cast<Bfloat16*>(to.get_data_handle()));
    } else {
      std::copy_n(values, size, static_cast<float*>(to.get_data_handle()));
    }
  }

  void Execute(const Product& product) {
    product.matmul.execute(stream_, product.arguments);
    stream_.wait();
  }

  int rows_;
  int columns_;
  int short_;
  int long_;
  memory::data_type type_;
  dnnl::engine engine_{dnnl::engine::kind::cpu, 0};
  dnnl::stream stream_{engine_};
  memory x_;  ///< short_ x long_
  memory a_;
  memory b_;
  memory narrow_x_;
  memory narrow_a_;
  memory narrow_b_;
  Product gram_;
  Product square_;
  Product product_;
  std::vector<float> scratch_;
};

HeadOptimizer::HeadOptimizer(const ParameterLayout& layout, Precision precision)
    : layout_(layout), momentum_(layout.size()), variance_(layout.size()) {
  const HeadShape& shape = layout.shape();
  for (int layer = 0; layer + 1 < shape.layer_count(); ++layer) {
    orthogonalisers_.push_back(std::make_unique<Orthogonaliser>(
        shape.LayerInputs(layer), shape.LayerOutputs(layer), precision));
  }
}

HeadOptimizer::~HeadOptimizer() = default;

void HeadOptimizer::UpdateLayer(int layer,
                                const OptimizerStep& step,
                                std::span<const float> gradient,
                                std::span<float> parameters) {
  const bool is_last = layer + 1 == layout_.shape().layer_count();
  const std::size_t weights = layout_.WeightsBegin(layer);
  const std::size_t bias = layout_.BiasBegin(layer);
  const std::size_t end = is_last ? layout_.size() : layout_.WeightsBegin(layer + 1);
  const std::size_t adam = is_last ? weights : bias;
  UpdateByAdam(MakeAdamStep(step),
               {end - adam,
                parameters.data() + adam,
                momentum_.data() + adam,
                variance_.data() + adam,
                gradient.data() + adam});
  if (is_last) return;

  Orthogonaliser& orthogonaliser = *orthogonalisers_[static_cast<std::size_t>(layer)];
  std::vector<float>& direction = orthogonaliser.matrix();
  const float squares = AddMomentum(
      gradient.data() + weights, direction.size(), momentum_.data() + weights, direction.data());
  if (!(squares > 0.0F))
    return;  // nothing was learned, as at the start behind a last layer of zeros
  orthogonaliser.Run(std::sqrt(squares));
  MoveAgainst(direction.data(),
              direction.size(),
              static_cast<float>(step.matrix_rate),
              static_cast<float>(1.0 - step.matrix_rate * step.weight_decay),
              parameters.data() + weights);
}

}  // namespace relocd
