#include "scene_coordinates/onednn_head.h"

#include <memory>
#include <span>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene_coordinates/test_map.h"

namespace relocd {
namespace {

constexpr HeadShape kShape{.inputs = 48, .width = 64, .blocks = 2};

/// The largest distance between the points of the reference and those of the engine, in m.
double WorstDifference(Precision precision, std::size_t rows) {
  const Head head = MakeTestHead(kShape, 4);
  const std::vector<float> features = RandomFloats(rows * 48, 1.0, 9);
  auto network = OnednnLayers::ForHead(head, precision, TeamOfOne());
  EXPECT_TRUE(network);
  std::vector<float> outputs(rows * kHeadOutputs);
  (*network)->Run(features, outputs);
  const std::vector<ScenePoint> expected = EvaluateHead(head, features);
  double worst = 0.0;
  for (std::size_t row = 0; row < rows; ++row) {
    const std::span<const float, kHeadOutputs> output(outputs.data() + row * kHeadOutputs,
                                                      kHeadOutputs);
    const ScenePoint point = DecodeHeadOutput(head, output);
    worst = std::max(worst, static_cast<double>((point.p_WP - expected[row].p_WP).norm()));
  }
  return worst;
}

class OnednnHeadRowsTest : public testing::TestWithParam<std::size_t> {};

TEST_P(OnednnHeadRowsTest, AgreesWithTheReference) {
  EXPECT_LT(WorstDifference(Precision::kFloat32, GetParam()), 1e-2);  // of points 30 m off
}

INSTANTIATE_TEST_SUITE_P(Rows, OnednnHeadRowsTest, testing::Values(1, 127, 128, 600));

std::vector<float> OutputsOn(int threads, std::span<const float> features) {
  auto network = OnednnLayers::ForHead(
      MakeTestHead(kShape, 4), Precision::kFastest, std::make_shared<ThreadTeam>(threads));
  std::vector<float> outputs(features.size() / 48 * kHeadOutputs);
  (*network)->Run(features, outputs);
  return outputs;
}

TEST(OnednnHeadTest, GivesTheSameBitsOnAnyNumberOfThreads) {
  for (const std::size_t rows : {1, 2, 127, 600}) {
    const std::vector<float> features = RandomFloats(rows * 48, 1.0, 9);
    const std::vector<float> alone = OutputsOn(1, features);
    EXPECT_EQ(OutputsOn(2, features), alone);
    EXPECT_EQ(OutputsOn(3, features), alone);
  }
}

TEST(OnednnHeadTest, Bfloat16IsNearTheReference) {
  if (FastestPrecision() != Precision::kBfloat16) GTEST_SKIP() << "this CPU has no bfloat16";
  EXPECT_LT(WorstDifference(Precision::kBfloat16, 600), 3.0);
}

TEST(OnednnHeadTest, RunsTheWhitening) {
  const SceneMap map = MakeTestMap();
  const std::vector<float> features = RandomFloats(std::size_t{272} * 300, 0.3, 5);
  auto network = OnednnLayers::ForWhitening(map.whitening, TeamOfOne());
  ASSERT_TRUE(network);
  EXPECT_EQ((*network)->inputs(), 272);
  EXPECT_EQ((*network)->outputs(), 24);
  std::vector<float> whitened(std::size_t{24} * 300);
  std::vector<float> expected(whitened.size());
  (*network)->Run(features, whitened);
  map.whitening.Apply(features, expected);
  for (std::size_t i = 0; i < whitened.size(); ++i) {
    ASSERT_NEAR(whitened[i], expected[i], 1e-3F);
  }
}

}  // namespace
}  // namespace relocd
