#include "scene_coordinates/onednn_head.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <omp.h>
#include <oneapi/dnnl/dnnl.hpp>

#include "core/check.h"
#include "scene_coordinates/bfloat16.h"

namespace relocd {
namespace {

using dnnl::memory;

/// 256 rows x 256 values x 4 bytes x 3 buffers fit a second-level cache of 1 MiB.
constexpr std::int64_t kBlockRows = 256;

struct LayerPlan {
  int inputs = 0;
  int outputs = 0;
  bool relu = false;
  bool adds_to_output = false;  ///< The block's input already lies in the output buffer.
  std::size_t in_buffer = 0;
  std::size_t out_buffer = 0;
  memory::data_type in_type = memory::data_type::f32;
  memory::data_type out_type = memory::data_type::f32;
};

/// How a head's layers use three buffers: the hidden values that a block adds to stay in `hidden`,
/// and the block's own go through the other two back to it.
std::vector<LayerPlan> PlanLayers(const HeadShape& shape, memory::data_type type) {
  std::vector<LayerPlan> plans;
  std::size_t hidden = 0;
  const int last = shape.layer_count() - 1;
  for (int index = 0; index <= last; ++index) {
    LayerPlan plan;
    plan.inputs = shape.LayerInputs(index);
    plan.outputs = shape.LayerOutputs(index);
    plan.relu = index < last;
    plan.in_type = index < last ? type : memory::data_type::f32;
    plan.out_type = index + 1 < last ? type : memory::data_type::f32;
    const int place_in_block = index >= 1 && index <= 3 * shape.blocks ? (index - 1) % 3 : -1;
    if (place_in_block < 0) {
      plan.in_buffer = hidden;
      hidden = (hidden + 1) % 3;
      plan.out_buffer = hidden;
    } else {
      plan.in_buffer = (hidden + static_cast<std::size_t>(place_in_block)) % 3;
      plan.out_buffer = (plan.in_buffer + 1) % 3;
      plan.adds_to_output = place_in_block == 2;
    }
    plans.push_back(plan);
  }
  return plans;
}

struct Step {
  dnnl::matmul matmul;
  std::unordered_map<int, memory> arguments;
};

memory::desc Rows(std::int64_t rows, std::int64_t columns, memory::data_type type) {
  return {{rows, columns}, type, memory::format_tag::ab};
}

__attribute__((target_clones("default", "arch=x86-64-v3"))) void Narrow(const float* in,
                                                                        std::size_t size,
                                                                        Bfloat16* out) {
  for (std::size_t i = 0; i < size; ++i) {
    out[i] = ToBfloat16(in[i]);
  }
}

}  // namespace

Precision FastestPrecision() {
  const auto isa = static_cast<unsigned>(dnnl::get_effective_cpu_isa());
  const auto wanted = static_cast<unsigned>(dnnl::cpu_isa::avx512_core_bf16);
  return (isa & wanted) == wanted ? Precision::kBfloat16 : Precision::kFloat32;
}

struct OnednnLayers::Network {
  int threads = 1;
  int inputs = 0;
  int outputs = 0;
  memory::data_type type = memory::data_type::f32;
  dnnl::engine engine{dnnl::engine::kind::cpu, 0};
  dnnl::stream stream{engine};
  std::vector<memory> buffers;
  std::vector<Step> steps;
  memory in;
  memory out;

  void AddLayer(const LayerPlan& plan, std::span<const float> weights, std::span<const float> bias);
  [[nodiscard]] memory Weights(const memory::desc& desc, std::span<const float> values);
};

memory OnednnLayers::Network::Weights(const memory::desc& desc, std::span<const float> values) {
  // Reordering converts to bfloat16 where the layer works in that.
  memory given(Rows(desc.dims()[0], desc.dims()[1], memory::data_type::f32), engine);
  std::copy(values.begin(), values.end(), static_cast<float*>(given.get_data_handle()));
  memory wanted(desc, engine);
  dnnl::reorder(given, wanted).execute(stream, given, wanted);
  stream.wait();
  return wanted;
}

void OnednnLayers::Network::AddLayer(const LayerPlan& plan,
                                     std::span<const float> weights,
                                     std::span<const float> bias) {
  dnnl::post_ops post_ops;
  if (plan.adds_to_output) post_ops.append_sum(1.0F);
  if (plan.relu) post_ops.append_eltwise(1.0F, dnnl::algorithm::eltwise_relu, 0.0F, 0.0F);
  dnnl::primitive_attr attributes;
  attributes.set_post_ops(post_ops);
  const memory::desc in_desc = Rows(kBlockRows, plan.inputs, plan.in_type);
  const memory::desc out_desc = Rows(kBlockRows, plan.outputs, plan.out_type);
  const memory::desc weights_desc(
      {plan.inputs, plan.outputs}, plan.in_type, memory::format_tag::any);
  const memory::desc bias_desc = Rows(1, plan.outputs, memory::data_type::f32);
  const dnnl::matmul::primitive_desc description(
      {in_desc, weights_desc, bias_desc, out_desc}, attributes, engine);
  const memory layer_in(in_desc, engine, buffers[plan.in_buffer].get_data_handle());
  std::fill_n(static_cast<float*>(buffers[plan.in_buffer].get_data_handle()),
              buffers[plan.in_buffer].get_desc().get_size() / sizeof(float),
              0.0F);  // unused rows are multiplied too
  const memory layer_out(out_desc, engine, buffers[plan.out_buffer].get_data_handle());
  steps.push_back({dnnl::matmul(description),
                   {{DNNL_ARG_SRC, layer_in},
                    {DNNL_ARG_WEIGHTS, Weights(description.weights_desc(), weights)},
                    {DNNL_ARG_BIAS, Weights(bias_desc, bias)},
                    {DNNL_ARG_DST, layer_out}}});
  in = steps.size() == 1 ? layer_in : in;
  out = layer_out;
}

OnednnLayers::OnednnLayers(std::unique_ptr<Network> network) : network_(std::move(network)) {}
OnednnLayers::~OnednnLayers() = default;

int OnednnLayers::inputs() const {
  return network_->inputs;
}
int OnednnLayers::outputs() const {
  return network_->outputs;
}

Result<std::unique_ptr<OnednnLayers>> OnednnLayers::ForHead(const Head& head,
                                                            Precision precision,
                                                            int threads) {
  if (precision == Precision::kFastest) precision = FastestPrecision();
  try {
    omp_set_num_threads(threads);
    auto network = std::make_unique<Network>();
    network->threads = threads;
    network->inputs = head.shape.inputs;
    network->outputs = kHeadOutputs;
    network->type =
        precision == Precision::kBfloat16 ? memory::data_type::bf16 : memory::data_type::f32;
    const int widest = std::max({head.shape.inputs, head.shape.width, kHeadOutputs});
    for (int buffer = 0; buffer < 3; ++buffer) {
      network->buffers.emplace_back(Rows(kBlockRows, widest, memory::data_type::f32),
                                    network->engine);
    }
    const std::vector<LayerPlan> plans = PlanLayers(head.shape, network->type);
    for (std::size_t index = 0; index < plans.size(); ++index) {
      network->AddLayer(plans[index], head.layers[index].weights, head.layers[index].bias);
    }
    return std::unique_ptr<OnednnLayers>(new OnednnLayers(std::move(network)));
  } catch (const dnnl::error& error) {
    return Error{ErrorKind::kInternal, fmt::format("making the head's network: {}", error.what())};
  }
}

Result<std::unique_ptr<OnednnLayers>> OnednnLayers::ForWhitening(const FeatureWhitening& whitening,
                                                                 int threads) {
  try {
    omp_set_num_threads(threads);
    auto network = std::make_unique<Network>();
    network->threads = threads;
    network->inputs = whitening.inputs;
    network->outputs = whitening.outputs;
    network->buffers.emplace_back(Rows(kBlockRows, whitening.inputs, memory::data_type::f32),
                                  network->engine);
    network->buffers.emplace_back(Rows(kBlockRows, whitening.outputs, memory::data_type::f32),
                                  network->engine);
    LayerPlan plan;
    plan.inputs = whitening.inputs;
    plan.outputs = whitening.outputs;
    plan.out_buffer = 1;
    network->AddLayer(plan, whitening.basis, whitening.Offset());
    return std::unique_ptr<OnednnLayers>(new OnednnLayers(std::move(network)));
  } catch (const dnnl::error& error) {
    return Error{ErrorKind::kInternal, fmt::format("making the whitening: {}", error.what())};
  }
}

void OnednnLayers::Run(std::span<const float> in, std::span<float> out) {
  const auto inputs = static_cast<std::size_t>(network_->inputs);
  const auto outputs = static_cast<std::size_t>(network_->outputs);
  const std::size_t rows = in.size() / inputs;
  RELOCD_CHECK(in.size() == rows * inputs && out.size() == rows * outputs,
               "in and out must have the same number of whole rows");
  omp_set_num_threads(network_->threads);
  for (std::size_t row = 0; row < rows; row += kBlockRows) {
    // The rows after the last are what the block before left there; nobody reads their results.
    const std::size_t block_rows = std::min<std::size_t>(kBlockRows, rows - row);
    const float* block_in = in.data() + row * inputs;
    if (network_->type == memory::data_type::bf16) {
      Narrow(block_in, block_rows * inputs, static_cast<Bfloat16*>(network_->in.get_data_handle()));
    } else {
      std::copy_n(
          block_in, block_rows * inputs, static_cast<float*>(network_->in.get_data_handle()));
    }
    for (const Step& step : network_->steps) {
      step.matmul.execute(network_->stream, step.arguments);
    }
    network_->stream.wait();
    std::copy_n(static_cast<const float*>(network_->out.get_data_handle()),
                block_rows * outputs,
                out.data() + row * outputs);
  }
}

}  // namespace relocd
