#include "odometry/wheel_encoder.h"

#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace relocd {
namespace {

struct TickCase {
  std::string name;
  std::uint64_t before;
  std::uint64_t after;
  int bits;
  std::int64_t expected;
};

class TickDifferenceTest : public testing::TestWithParam<TickCase> {};

TEST_P(TickDifferenceTest, TakesTheShorterWay) {
  const TickCase& param = GetParam();
  EXPECT_EQ(TickDifference(param.before, param.after, param.bits), param.expected);
}

INSTANTIATE_TEST_SUITE_P(Counters,
                         TickDifferenceTest,
                         testing::ValuesIn(std::vector<TickCase>{
                             {"Still", 100, 100, 16, 0},
                             {"Forward", 100, 130, 16, 30},
                             {"Backward", 130, 100, 16, -30},
                             {"ForwardAcrossTheWrap", 65530, 4, 16, 10},
                             {"BackwardAcrossTheWrap", 4, 65530, 16, -10},
                             {"FurthestForward", 0, 32767, 16, 32767},
                             {"FurthestBackward", 0, 32768, 16, -32768},
                             {"NarrowCounter", 15, 1, 4, 2},
                             {"WideCounter", 0xFFFFFFFF, 1, 32, 2},
                             {"WidestCounter", 0x7FFFFFFFFFFFFFFF, 0, 63, 1},
                             {"OneBit", 0, 1, 1, -1},
                         }),
                         [](const auto& instance) { return instance.param.name; });

TEST(TickDifferenceTest, SumsToWhatTheWheelDidWhateverTheWidth) {
  std::mt19937_64 engine(1);
  for (int i = 0; i < 1000; ++i) {
    const int bits = static_cast<int>(engine() % 56) + 8;
    const std::uint64_t mask = ~std::uint64_t{0} >> static_cast<unsigned>(64 - bits);
    std::int64_t truth = static_cast<std::int64_t>(engine() % 1000);
    std::int64_t sum = truth;
    for (int k = 0; k < 100; ++k) {
      const std::int64_t before = truth;
      truth += static_cast<std::int64_t>(engine() % 255) - 127;
      sum += TickDifference(static_cast<std::uint64_t>(before) & mask,
                            static_cast<std::uint64_t>(truth) & mask,
                            bits);
    }
    ASSERT_EQ(sum, truth);
  }
}

TEST(MaxTickDifferenceTest, IsTheFurthestForward) {
  EXPECT_EQ(MaxTickDifference(16), 32767);
  EXPECT_EQ(MaxTickDifference(8), 127);
}

}  // namespace
}  // namespace relocd
