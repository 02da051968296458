#include "scene_coordinates/head.h"

#include <array>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scene_coordinates/test_map.h"

namespace relocd {
namespace {

TEST(HeadTest, ANewHeadPutsEveryPointAtTheCentre) {
  Head head = MakeRandomHead({.inputs = 12, .width = 16, .blocks = 1}, 5);
  head.centre_W = {3.0, 4.0, 5.0};
  head.scale_m = 100.0;
  const auto points = EvaluateHead(head, RandomFloats(24, 1.0, 1));
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[1].p_WP, Eigen::Vector3f(3.0F, 4.0F, 5.0F));
  EXPECT_FLOAT_EQ(points[1].confidence, 0.5F);
}

TEST(HeadTest, LayersFitTheShape) {
  const HeadShape shape{.inputs = 12, .width = 16, .blocks = 2};
  const Head head = MakeRandomHead(shape, 1);
  ASSERT_EQ(head.layers.size(), 10U);
  EXPECT_EQ(head.layers.front().inputs, 12);
  EXPECT_EQ(head.layers.back().outputs, kHeadOutputs);
  EXPECT_TRUE(shape.EndsBlock(3));
  EXPECT_TRUE(shape.EndsBlock(6));
  EXPECT_FALSE(shape.EndsBlock(0));
  EXPECT_FALSE(shape.EndsBlock(9));
}

TEST(HeadTest, HomogeneousScaleIsPositiveAndItsSlopeAgreesWithDifferences) {
  EXPECT_NEAR(HomogeneousScale(0.0F), 1.01F, 1e-5F);
  for (const float raw : {-50.0F, -3.0F, -0.1F, 0.0F, 0.7F, 4.0F, 80.0F}) {
    constexpr float kStep = 1e-2F;
    EXPECT_GT(HomogeneousScale(raw), 0.0F);
    const float difference =
        (HomogeneousScale(raw + kStep) - HomogeneousScale(raw - kStep)) / (2.0F * kStep);
    EXPECT_NEAR(HomogeneousScaleSlope(raw), difference, 2e-3F) << raw;
  }
}

TEST(HeadTest, HalvingTheHomogeneousScaleDoublesTheDistanceFromTheCentre) {
  const Head head = MakeTestHead({.inputs = 12, .width = 16, .blocks = 0}, 1);
  const std::array<float, kHeadOutputs> output = {1.0F, 2.0F, 3.0F, 0.0F, 2.0F};
  const ScenePoint point = DecodeHeadOutput(head, output);
  const Eigen::Vector3f expected =
      head.centre_W.cast<float>() + 30.0F / 1.01F * Eigen::Vector3f(1.0F, 2.0F, 3.0F);
  EXPECT_LT((point.p_WP - expected).norm(), 1e-3F);
  EXPECT_NEAR(point.confidence, 1.0F / (1.0F + std::exp(-2.0F)), 1e-6F);
}

TEST(HeadTest, RefusesAShapeOutOfRange) {
  const auto valid = HeadShape{.inputs = 12, .width = 4, .blocks = 1}.Validate();
  ASSERT_FALSE(valid);
  EXPECT_EQ(valid.error().message, "head.width is 4, must be in [16, 2048]");
}

}  // namespace
}  // namespace relocd
