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

/// 128 rows x 256 values x 4 bytes x 3 buffers fit a second-level cache beside the weights of a
/// layer, and a thread's last block has few rows that are multiplied for nothing.
constexpr std::int64_t kBlockRows = 128;

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

/// A layer as all threads share it.
struct Layer {
  LayerPlan plan;
  dnnl::matmul matmul;
  memory weights;
  memory bias;
  memory::desc scratchpad;
};

/// What one thread works with: its own buffers, for a block of rows.
struct Worker {
  dnnl::stream stream;
  std::vector<memory> buffers;
  std::vector<std::unordered_map<int, memory>> arguments;  ///< Of each layer.

  [[nodiscard]] void* in() const { return arguments.front().at(DNNL_ARG_SRC).get_data_handle(); }
  [[nodiscard]] void* out() const { return arguments.back().at(DNNL_ARG_DST).get_data_handle(); }
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
  std::shared_ptr<ThreadTeam> team;
  int inputs = 0;
  int outputs = 0;
  memory::data_type type = memory::data_type::f32;
  dnnl::engine engine{dnnl::engine::kind::cpu, 0};
  std::vector<Layer> layers;
  std::vector<Worker> workers;  ///< One for each thread of the team.

  void AddLayer(const LayerPlan& plan, std::span<const float> weights, std::span<const float> bias);
  void AddWorkers();
  void RunRows(Worker& worker, std::span<const float> in, std::span<float> out) const;

 private:
  [[nodiscard]] memory Weights(const memory::desc& desc, std::span<const float> values) const;
  [[nodiscard]] Worker MakeWorker() const;
};

memory OnednnLayers::Network::Weights(const memory::desc& desc,
                                      std::span<const float> values) const {
  // Reordering converts to bfloat16 where the layer works in that.
  memory given(Rows(desc.dims()[0], desc.dims()[1], memory::data_type::f32), engine);
  std::copy(values.begin(), values.end(), static_cast<float*>(given.get_data_handle()));
  memory wanted(desc, engine);
  dnnl::stream stream(engine);
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
  // Several threads may then run one primitive.
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
  const memory::desc weights_desc(
      {plan.inputs, plan.outputs}, plan.in_type, memory::format_tag::any);
  const memory::desc bias_desc = Rows(1, plan.outputs, memory::data_type::f32);
  const dnnl::matmul::primitive_desc description({Rows(kBlockRows, plan.inputs, plan.in_type),
                                                  weights_desc,
                                                  bias_desc,
                                                  Rows(kBlockRows, plan.outputs, plan.out_type)},
                                                 attributes,
                                                 engine);
  layers.push_back({.plan = plan,
                    .matmul = dnnl::matmul(description),
                    .weights = Weights(description.weights_desc(), weights),
                    .bias = Weights(bias_desc, bias),
                    .scratchpad = description.scratchpad_desc()});
}

Worker OnednnLayers::Network::MakeWorker() const {
  Worker worker{.stream = dnnl::stream(engine), .buffers = {}, .arguments = {}};
  std::size_t buffers = 0;
  int widest = 0;
  for (const Layer& layer : layers) {
    buffers = std::max({buffers, layer.plan.in_buffer + 1, layer.plan.out_buffer + 1});
    widest = std::max({widest, layer.plan.inputs, layer.plan.outputs});
  }
  for (std::size_t buffer = 0; buffer < buffers; ++buffer) {
    const memory& made =
        worker.buffers.emplace_back(Rows(kBlockRows, widest, memory::data_type::f32), engine);
    std::fill_n(static_cast<float*>(made.get_data_handle()),
                kBlockRows * widest,
                0.0F);  // unused rows are multiplied too
  }
  for (const Layer& layer : layers) {
    const LayerPlan& plan = layer.plan;
    const auto place = [&](std::size_t buffer, int columns, memory::data_type number) {
      return memory(
          Rows(kBlockRows, columns, number), engine, worker.buffers[buffer].get_data_handle());
    };
    worker.arguments.push_back({{DNNL_ARG_SRC, place(plan.in_buffer, plan.inputs, plan.in_type)},
                                {DNNL_ARG_WEIGHTS, layer.weights},
                                {DNNL_ARG_BIAS, layer.bias},
                                {DNNL_ARG_DST, place(plan.out_buffer, plan.outputs, plan.out_type)},
                                {DNNL_ARG_SCRATCHPAD, memory(layer.scratchpad, engine)}});
  }
  return worker;
}

void OnednnLayers::Network::AddWorkers() {
  for (int part = 0; part < team->size(); ++part)
    workers.push_back(MakeWorker());
}

void OnednnLayers::Network::RunRows(Worker& worker,
                                    std::span<const float> in,
                                    std::span<float> out) const {
  const auto row_in = static_cast<std::size_t>(inputs);
  const auto row_out = static_cast<std::size_t>(outputs);
  const std::size_t rows = in.size() / row_in;
  for (std::size_t row = 0; row < rows; row += kBlockRows) {
    // The rows after the last are what the block before left there; nobody reads their results.
    const std::size_t block_rows = std::min<std::size_t>(kBlockRows, rows - row);
    const float* block_in = in.data() + row * row_in;
    if (type == memory::data_type::bf16) {
      Narrow(block_in, block_rows * row_in, static_cast<Bfloat16*>(worker.in()));
    } else {
      std::copy_n(block_in, block_rows * row_in, static_cast<float*>(worker.in()));
    }
    for (std::size_t layer = 0; layer < layers.size(); ++layer)
      layers[layer].matmul.execute(worker.stream, worker.arguments[layer]);
    worker.stream.wait();
    std::copy_n(
        static_cast<const float*>(worker.out()), block_rows * row_out, out.data() + row * row_out);
  }
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
                                                            std::shared_ptr<ThreadTeam> team) {
  if (precision == Precision::kFastest) precision = FastestPrecision();
  try {
    omp_set_num_threads(1);
    auto network = std::make_unique<Network>();
    network->team = std::move(team);
    network->inputs = head.shape.inputs;
    network->outputs = kHeadOutputs;
    network->type =
        precision == Precision::kBfloat16 ? memory::data_type::bf16 : memory::data_type::f32;
    const std::vector<LayerPlan> plans = PlanLayers(head.shape, network->type);
    for (std::size_t index = 0; index < plans.size(); ++index) {
      network->AddLayer(plans[index], head.layers[index].weights, head.layers[index].bias);
    }
    network->AddWorkers();
    return std::unique_ptr<OnednnLayers>(new OnednnLayers(std::move(network)));
  } catch (const dnnl::error& error) {
    return Error{ErrorKind::kInternal, fmt::format("making the head's network: {}", error.what())};
  }
}

Result<std::unique_ptr<OnednnLayers>> OnednnLayers::ForWhitening(const FeatureWhitening& whitening,
                                                                 std::shared_ptr<ThreadTeam> team) {
  try {
    omp_set_num_threads(1);
    auto network = std::make_unique<Network>();
    network->team = std::move(team);
    network->inputs = whitening.inputs;
    network->outputs = whitening.outputs;
    network->AddLayer({.inputs = whitening.inputs, .outputs = whitening.outputs, .out_buffer = 1},
                      whitening.basis,
                      whitening.Offset());
    network->AddWorkers();
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
  ThreadTeam& team = *network_->team;
  team.Run([&](int part) {
    // oneDNN's own threads wait for each other after each layer, and take a core for it.
    omp_set_num_threads(1);
    const PartRange range = RangeOfPart(static_cast<int>(rows), part, team.size());
    const auto begin = static_cast<std::size_t>(range.begin);
    const auto count = static_cast<std::size_t>(range.end) - begin;
    network_->RunRows(network_->workers[static_cast<std::size_t>(part)],
                      in.subspan(begin * inputs, count * inputs),
                      out.subspan(begin * outputs, count * outputs));
  });
}

}  // namespace relocd
