#include "map_checkpoint.h"

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "core/sha256.h"
#include "support/random.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

TrainerState MakeState(int parameters) {
  TestRandom random(5);
  TrainerState state{.iteration = 1234, .parameters = {}, .momentum = {}, .variance = {}};
  for (int i = 0; i < parameters; ++i) {
    state.parameters.push_back(static_cast<float>(random.Normal(1.0)));
    state.momentum.push_back(static_cast<float>(random.Normal(1e-3)));
    state.variance.push_back(static_cast<float>(random.Uniform(0.0, 1e-6)));
  }
  return state;
}

const std::string kFingerprint = Sha256Hex("data and options");

TEST(MapCheckpointTest, AStateComesBackToTheBit) {
  const TrainerState state = MakeState(1000);
  const auto back = ParseState(SerializeState(state, kFingerprint), kFingerprint);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->iteration, state.iteration);
  EXPECT_EQ(back->parameters, state.parameters);
  EXPECT_EQ(back->momentum, state.momentum);
  EXPECT_EQ(back->variance, state.variance);
}

TEST(MapCheckpointTest, AStateOfOtherDataIsNone) {
  const std::string bytes = SerializeState(MakeState(10), kFingerprint);
  EXPECT_FALSE(ParseState(bytes, Sha256Hex("other data")));
  EXPECT_FALSE(ParseState(bytes, "short"));
}

TEST(MapCheckpointTest, DamagedBytesAreNoState) {
  const std::string bytes = SerializeState(MakeState(20), kFingerprint);
  TestRandom random(6);
  for (int trial = 0; trial < 1000; ++trial) {
    std::string damaged = bytes;
    if (random.Integer(0, 1) == 0) {
      damaged.resize(
          static_cast<std::size_t>(random.Integer(0, static_cast<int>(bytes.size()) - 1)));
    } else {
      const int at = random.Integer(0, static_cast<int>(bytes.size()) - 1);
      damaged[static_cast<std::size_t>(at)] ^= static_cast<char>(random.Integer(1, 255));
    }
    EXPECT_FALSE(ParseState(damaged, kFingerprint));
  }
}

TEST(MapCheckpointTest, WhatClaimsToBeLongerThanItIsIsNoState) {
  std::string bytes = SerializeState(MakeState(20), kFingerprint);
  bytes.resize(bytes.size() - 64);
  bytes[8 + 64 + 4] = '\x7f';  // many more parameters, rightly signed
  EXPECT_FALSE(ParseState(bytes + Sha256Hex(bytes), kFingerprint));
}

TEST(MapCheckpointTest, AFolderOfOtherDataIsEmptied) {
  const TemporaryFolder folder;
  const std::string map = folder.path() + "/a.relocmap";
  const auto first = TrainingFolder::Open(map, kFingerprint);
  ASSERT_TRUE(first);
  ASSERT_TRUE(first->KeepState(0, MakeState(5)));
  ASSERT_TRUE(first->KeepState(1, MakeState(5)));
  EXPECT_TRUE(TrainingFolder::Open(map, kFingerprint)->State(1));
  const auto other = TrainingFolder::Open(map, Sha256Hex("other"));
  EXPECT_FALSE(other->State(0));
  EXPECT_FALSE(std::filesystem::exists(other->path() + "/region1.state"));
  other->Remove();
  EXPECT_FALSE(std::filesystem::exists(other->path()));
}

}  // namespace
}  // namespace relocd
