#include "features/feature_whitening.h"

#include <limits>
#include <random>
#include <vector>

#include <Eigen/Core>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using testing::HasSubstr;
using RowMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int kSamples = 2000;
constexpr int kInputs = 12;
constexpr int kOutputs = 5;

/// Correlated samples with a mean that is not zero.
RowMatrix Samples(unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<float> normal;
  RowMatrix independent(kSamples, kInputs);
  RowMatrix mixing(kInputs, kInputs);
  for (float& value : independent.reshaped())
    value = normal(engine);
  for (float& value : mixing.reshaped())
    value = normal(engine);
  return (independent * mixing).rowwise() + Eigen::RowVectorXf::LinSpaced(kInputs, -3.0F, 8.0F);
}

std::span<const float> AsSpan(const RowMatrix& rows) {
  return {rows.data(), static_cast<std::size_t>(rows.size())};
}

TEST(FeatureWhiteningTest, GivesUncorrelatedDimensionsOfUnitVariance) {
  const RowMatrix samples = Samples(1);
  const auto whitening = FitWhitening(AsSpan(samples), kInputs, kOutputs);
  ASSERT_TRUE(whitening);
  RowMatrix whitened(kSamples, kOutputs);
  whitening->Apply(AsSpan(samples), {whitened.data(), static_cast<std::size_t>(whitened.size())});
  EXPECT_LT(whitened.colwise().mean().cwiseAbs().maxCoeff(), 1e-3F);
  const Eigen::MatrixXf covariance = whitened.transpose() * whitened / kSamples;
  EXPECT_LT((covariance - Eigen::MatrixXf::Identity(kOutputs, kOutputs)).cwiseAbs().maxCoeff(),
            1e-2F);
}

TEST(FeatureWhiteningTest, OffsetIsWhatZeroBecomes) {
  const RowMatrix samples = Samples(2);
  const auto whitening = FitWhitening(AsSpan(samples), kInputs, kOutputs);
  ASSERT_TRUE(whitening);
  std::vector<float> whitened(kOutputs);
  whitening->Apply(std::vector<float>(kInputs, 0.0F), whitened);
  const std::vector<float> offset = whitening->Offset();
  for (std::size_t i = 0; i < kOutputs; ++i) {
    EXPECT_NEAR(offset[i], whitened[i], 1e-4F);
  }
}

TEST(FeatureWhiteningTest, RefusesTooFewSamples) {
  const auto whitening = FitWhitening(std::vector<float>(kInputs * 3, 0.0F), kInputs, kOutputs);
  ASSERT_FALSE(whitening);
  EXPECT_THAT(whitening.error().message, HasSubstr("whitening 3 features of 12 dimensions"));
}

TEST(FeatureWhiteningTest, RefusesSamplesThatAreNotFinite) {
  RowMatrix samples = Samples(3);
  samples(7, 3) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(FitWhitening(AsSpan(samples), kInputs, kOutputs));
}

}  // namespace
}  // namespace relocd
