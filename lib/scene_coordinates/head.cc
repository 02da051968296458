#include "scene_coordinates/head.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <tuple>

#include <fmt/format.h>

#include "core/check.h"

namespace relocd {
namespace {

/// Keeps points from running to infinity.
constexpr float kMinHomogeneous = 0.01F;

void RunLayer(const HeadLayer& layer, const std::vector<float>& in, std::vector<float>& out) {
  out = layer.bias;
  const auto outputs = static_cast<std::size_t>(layer.outputs);
  for (std::size_t input = 0; input < in.size(); ++input) {
    for (std::size_t output = 0; output < outputs; ++output) {
      out[output] += in[input] * layer.weights[input * outputs + output];
    }
  }
}

/// The network's outputs for one cell.
std::vector<float> RunHead(const Head& head, std::span<const float> features) {
  std::vector<float> in(features.begin(), features.end());
  std::vector<float> out;
  std::vector<float> block_input;
  const int last = head.shape.layer_count() - 1;
  for (int index = 0; index <= last; ++index) {
    const bool begins_block = index >= 1 && head.shape.EndsBlock(index + 2);
    if (begins_block) block_input = in;
    RunLayer(head.layers[static_cast<std::size_t>(index)], in, out);
    if (index == last) break;
    if (head.shape.EndsBlock(index)) {
      std::transform(out.begin(), out.end(), block_input.begin(), out.begin(), std::plus<>());
    }
    std::transform(
        out.begin(), out.end(), out.begin(), [](float value) { return std::max(value, 0.0F); });
    in.swap(out);
  }
  return out;
}

}  // namespace

Result<void> HeadShape::Validate() const {
  using Rule = std::tuple<const char*, int, int, int>;
  for (const auto& [field, value, low, high] : {Rule{"inputs", inputs, 1, 4096},
                                                Rule{"width", width, 16, 2048},
                                                Rule{"blocks", blocks, 0, 16}}) {
    if (value < low || value > high) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("head.{} is {}, must be in [{}, {}]", field, value, low, high)};
    }
  }
  return {};
}

int HeadShape::LayerOutputs(int layer) const {
  return layer == layer_count() - 1 ? kHeadOutputs : width;
}

Head MakeRandomHead(const HeadShape& shape, std::uint64_t seed) {
  Head head;
  head.shape = shape;
  std::mt19937_64 engine(seed);
  for (int index = 0; index < shape.layer_count(); ++index) {
    HeadLayer layer;
    layer.inputs = shape.LayerInputs(index);
    layer.outputs = shape.LayerOutputs(index);
    // He et al. (2015): keeps the variance through relu. Halved where a block ends, so that the sum
    // with its input does not grow from block to block.
    const bool is_last = index + 1 == shape.layer_count();
    const double gain = shape.EndsBlock(index) ? 0.5 : 1.0;
    const double sigma = is_last ? 0.0 : gain * std::sqrt(2.0 / layer.inputs);
    std::normal_distribution<double> weight(0.0, 1.0);
    layer.weights.resize(static_cast<std::size_t>(layer.inputs) *
                         static_cast<std::size_t>(layer.outputs));
    for (float& value : layer.weights) {
      value = static_cast<float>(sigma * weight(engine));
    }
    layer.bias.assign(static_cast<std::size_t>(layer.outputs), 0.0F);
    head.layers.push_back(std::move(layer));
  }
  return head;
}

float HomogeneousScale(float raw) {
  // log2(1 + e^x), without overflow.
  const float softplus = std::max(raw, 0.0F) + std::log1p(std::exp(-std::abs(raw)));
  return kMinHomogeneous + softplus * std::numbers::log2e_v<float>;
}

float HomogeneousScaleSlope(float raw) {
  return std::numbers::log2e_v<float> / (1.0F + std::exp(-raw));
}

ScenePoint DecodeHeadOutput(const Head& head, std::span<const float, kHeadOutputs> output) {
  ScenePoint point;
  const float factor = static_cast<float>(head.scale_m) / HomogeneousScale(output[3]);
  point.p_WP =
      head.centre_W.cast<float>() + factor * Eigen::Vector3f(output[0], output[1], output[2]);
  point.confidence = 1.0F / (1.0F + std::exp(-output[4]));
  return point;
}

std::vector<ScenePoint> EvaluateHead(const Head& head, std::span<const float> features) {
  const auto inputs = static_cast<std::size_t>(head.shape.inputs);
  RELOCD_CHECK(features.size() % inputs == 0, "features must be n x inputs");
  std::vector<ScenePoint> points;
  for (std::size_t row = 0; row < features.size() / inputs; ++row) {
    const std::vector<float> output = RunHead(head, features.subspan(row * inputs, inputs));
    points.push_back(DecodeHeadOutput(head, std::span<const float, kHeadOutputs>(output)));
  }
  return points;
}

}  // namespace relocd
