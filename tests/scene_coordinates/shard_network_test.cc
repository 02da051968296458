#include "scene_coordinates/shard_network.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include "scene_coordinates/onednn_head.h"
#include "scene_coordinates/test_map.h"

namespace relocd {
namespace {

constexpr HeadShape kShape{.inputs = 20, .width = 32, .blocks = 2};
constexpr std::size_t kRows = 16;

/// A loss whose derivatives are plain: half the squared distance from fixed values.
class SquaredLoss final : public OutputLoss {
 public:
  void Evaluate(std::span<const float> outputs, std::span<float> gradients) override {
    value = 0.0;
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      gradients[i] = outputs[i] - targets_[i];
      value += 0.5 * double{gradients[i]} * double{gradients[i]};
    }
  }
  double value = 0.0;

 private:
  std::vector<float> targets_ = RandomFloats(kRows * kHeadOutputs, 1.0, 77);
};

template <typename Number>
std::vector<Number> Narrowed(const std::vector<float>& values) {
  std::vector<Number> narrowed(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if constexpr (std::is_same_v<Number, float>) {
      narrowed[i] = values[i];
    } else {
      narrowed[i] = ToBfloat16(values[i]);
    }
  }
  return narrowed;
}

/// Loss and gradient of the network with these parameters, on fixed features.
template <typename Number>
std::pair<double, std::vector<float>> LossAndGradient(const std::vector<float>& parameters) {
  omp_set_num_threads(1);
  const ParameterLayout layout(kShape);
  const std::vector<Number> narrow = Narrowed<Number>(parameters);
  ShardNetwork<Number> network(layout, kRows, parameters.data(), narrow.data());
  const std::vector<Number> features = Narrowed<Number>(RandomFloats(kRows * 20, 1.0, 5));
  for (std::size_t row = 0; row < kRows; ++row) {
    std::copy_n(features.begin() + static_cast<std::ptrdiff_t>(row * 20),
                20,
                network.InputRow(row).begin());
  }
  SquaredLoss loss;
  std::vector<float> gradient(layout.size());
  network.Run(loss, gradient);
  return {loss.value, gradient};
}

std::vector<float> TestParameters() {
  return FlattenHead(MakeTestHead(kShape, 3), ParameterLayout(kShape));
}

TEST(ShardNetworkTest, GradientAgreesWithDifferences) {
  const std::vector<float> parameters = TestParameters();
  const std::vector<float> gradient = LossAndGradient<float>(parameters).second;
  const ParameterLayout layout(kShape);
  // Some weights and biases of every layer.
  for (int layer = 0; layer < kShape.layer_count(); ++layer) {
    for (const std::size_t index : {layout.WeightsBegin(layer) + 3,
                                    layout.WeightsBegin(layer) + 41,
                                    layout.BiasBegin(layer) + 2}) {
      constexpr float kStep = 2e-3F;
      std::vector<float> up = parameters;
      std::vector<float> down = parameters;
      up[index] += kStep;
      down[index] -= kStep;
      const double difference =
          (LossAndGradient<float>(up).first - LossAndGradient<float>(down).first) / (2.0 * kStep);
      EXPECT_NEAR(gradient[index], difference, 0.02 * std::abs(difference) + 0.02)
          << "layer " << layer << ", parameter " << index;
    }
  }
}

TEST(ShardNetworkTest, ForwardAgreesWithTheReference) {
  const std::vector<float> parameters = TestParameters();
  Head head = MakeTestHead(kShape, 3);
  head.centre_W.setZero();
  head.scale_m = 1.0;
  Head unflattened;
  UnflattenHead(ParameterLayout(kShape), parameters, unflattened);
  for (std::size_t layer = 0; layer < head.layers.size(); ++layer) {
    EXPECT_EQ(unflattened.layers[layer].weights, head.layers[layer].weights);
    EXPECT_EQ(unflattened.layers[layer].bias, head.layers[layer].bias);
  }
}

TEST(ShardNetworkTest, Bfloat16GradientPointsTheSameWay) {
  if (FastestPrecision() != Precision::kBfloat16) GTEST_SKIP() << "this CPU has no bfloat16";
  const std::vector<float> parameters = TestParameters();
  const std::vector<float> exact = LossAndGradient<float>(parameters).second;
  const std::vector<float> narrow = LossAndGradient<Bfloat16>(parameters).second;
  double product = 0.0;
  double exact_squares = 0.0;
  double narrow_squares = 0.0;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    product += double{exact[i]} * double{narrow[i]};
    exact_squares += double{exact[i]} * double{exact[i]};
    narrow_squares += double{narrow[i]} * double{narrow[i]};
  }
  EXPECT_GT(product / std::sqrt(exact_squares * narrow_squares), 0.995);
}

}  // namespace
}  // namespace relocd
