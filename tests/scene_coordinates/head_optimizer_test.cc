#include "scene_coordinates/head_optimizer.h"

#include <algorithm>
#include <random>

#include <Eigen/SVD>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::vector<float> RandomValues(std::size_t size, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<float> normal(0.0F, 1e-3F);
  std::vector<float> values(size);
  std::generate(values.begin(), values.end(), [&] { return normal(engine); });
  return values;
}

/// What the first step of rate 1 does to a layer's weights, for a gradient whose singular values
/// differ by a factor of 30.
struct FirstStep {
  FirstStep(const HeadShape& shape, int layer, Precision precision) {
    const ParameterLayout layout(shape);
    std::vector<float> all = RandomValues(layout.size(), 5);
    const int rows = shape.LayerInputs(layer);
    const int columns = shape.LayerOutputs(layer);
    Eigen::Map<RowMajor> of_layer(all.data() + layout.WeightsBegin(layer), rows, columns);
    const Eigen::JacobiSVD<Eigen::MatrixXf> svd(of_layer,
                                                Eigen::ComputeThinU | Eigen::ComputeThinV);
    const Eigen::VectorXf values =
        Eigen::VectorXf::LinSpaced(svd.singularValues().size(), 3.0F, 0.1F);
    of_layer = svd.matrixU() * values.asDiagonal() * svd.matrixV().transpose();
    gradient = of_layer;
    nearest = svd.matrixU() * svd.matrixV().transpose();

    std::vector<float> parameters(layout.size(), 0.0F);
    HeadOptimizer optimizer(layout, precision);
    optimizer.UpdateLayer(
        layer, {.iteration = 0, .matrix_rate = 1.0, .rate = 0.01}, all, parameters);
    change = Eigen::Map<RowMajor>(parameters.data() + layout.WeightsBegin(layer), rows, columns);
    bias_change = Eigen::Map<Eigen::VectorXf>(parameters.data() + layout.BiasBegin(layer), columns);
    bias_gradient = Eigen::Map<Eigen::VectorXf>(all.data() + layout.BiasBegin(layer), columns);
  }

  RowMajor gradient;
  RowMajor nearest;  ///< The orthogonal matrix that is nearest to the gradient.
  RowMajor change;
  Eigen::VectorXf bias_change;
  Eigen::VectorXf bias_gradient;
};

class HeadOptimizerTest : public testing::TestWithParam<Precision> {};

TEST_P(HeadOptimizerTest, MovesAllDirectionsOfAHiddenLayerAtOneSpeed) {
  // Square, wider than high, and higher than wide.
  for (const auto& [inputs, layer] : {std::pair{48, 1}, std::pair{48, 0}, std::pair{96, 0}}) {
    const FirstStep step({.inputs = inputs, .width = 64, .blocks = 1}, layer, GetParam());
    const Eigen::VectorXf values = Eigen::JacobiSVD<Eigen::MatrixXf>(step.change).singularValues();
    EXPECT_LT(values.maxCoeff(), 1.3F) << inputs;
    EXPECT_GT(values.minCoeff(), 0.5F) << inputs;
    // Against the gradient, along the same singular vectors.
    const float alignment =
        -step.change.cwiseProduct(step.nearest).sum() / (step.change.norm() * step.nearest.norm());
    EXPECT_GT(alignment, 0.95F) << inputs;
    EXPECT_TRUE((step.bias_change.array() * step.bias_gradient.array() < 0.0F).all());
    EXPECT_NEAR(step.bias_change.cwiseAbs().mean(), 0.01F, 1e-4F) << "AdamW's first step";
  }
}

INSTANTIATE_TEST_SUITE_P(Precisions,
                         HeadOptimizerTest,
                         testing::Values(Precision::kFloat32, FastestPrecision()),
                         [](const auto& instance) {
                           return instance.index == 0 ? "Float32" : "Fastest";
                         });

TEST(HeadOptimizerEdgeTest, AGradientOfZeroMovesNothing) {
  const HeadShape shape{.inputs = 16, .width = 16, .blocks = 0};
  const ParameterLayout layout(shape);
  const std::vector<float> gradient(layout.size(), 0.0F);
  std::vector<float> parameters(layout.size(), 0.25F);
  HeadOptimizer optimizer(layout, Precision::kFloat32);
  for (int layer = 0; layer < shape.layer_count(); ++layer) {
    optimizer.UpdateLayer(layer, {.matrix_rate = 1.0, .rate = 0.1}, gradient, parameters);
  }
  EXPECT_EQ(parameters, std::vector<float>(layout.size(), 0.25F));
}

}  // namespace
}  // namespace relocd
