#include "smoothing/consensus.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "support/random.h"

namespace relocd {
namespace {

const Pose2 kX_WO(120.0, -40.0, 2.5);

/// Fixes every metre of a bent way, `outliers` of which are anywhere.
std::vector<ConsensusFix> MakeFixes(int count, int outliers, bool has_heading, unsigned seed) {
  TestRandom random(seed);
  std::vector<ConsensusFix> fixes;
  for (int i = 0; i < count; ++i) {
    ConsensusFix fix;
    fix.X_OB = Pose2(i, 0.02 * i * i, 0.04 * i);
    fix.has_heading = has_heading;
    fix.sigma_m = 0.3;
    fix.heading_sigma_rad = 0.05;
    const Pose2 X_WB = kX_WO * fix.X_OB;
    fix.X_WB = Pose2(X_WB.x() + random.Uniform(-0.3, 0.3),
                     X_WB.y() + random.Uniform(-0.3, 0.3),
                     X_WB.yaw() + random.Uniform(-0.05, 0.05));
    if (i < outliers) fix.X_WB = Pose2(100.0, 0.0, 0.0) * random.Pose();
    fixes.push_back(fix);
  }
  return fixes;
}

class ConsensusTest : public ::testing::TestWithParam<bool> {};

TEST_P(ConsensusTest, FindsThePoseThatHalfOfTheFixesAgreeOn) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const auto fixes = MakeFixes(40, 20, GetParam(), seed);
    const auto consensus = FindConsensus(fixes, {});
    ASSERT_TRUE(consensus);
    EXPECT_EQ(consensus->supporters, 20);
    const Pose2 error = kX_WO.Inverse() * consensus->X_WO;
    EXPECT_LT(error.translation().norm(), 0.6) << seed;
    EXPECT_LT(std::abs(error.yaw()), 0.05) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(Fixes, ConsensusTest, ::testing::Bool(), [](const auto& instance) {
  return instance.param ? "WithHeading" : "PositionsOnly";
});

TEST(ConsensusWithoutDirectionTest, ProposesNothingFromPositionsAtOnePlace) {
  std::vector<ConsensusFix> fixes = MakeFixes(40, 0, false, 1);
  for (ConsensusFix& fix : fixes)
    fix.X_OB = Pose2();
  EXPECT_FALSE(FindConsensus(fixes, {}));
}

TEST(ConsensusWithoutDirectionTest, ProposesNothingFromNothing) {
  EXPECT_FALSE(FindConsensus({}, {}));
}

}  // namespace
}  // namespace relocd
