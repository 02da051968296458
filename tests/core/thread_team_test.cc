#include "core/thread_team.h"

#include <atomic>
#include <barrier>
#include <numeric>

#include <gtest/gtest.h>

namespace relocd {
namespace {

TEST(ThreadTeamTest, DoesEachPartOnceInEachRound) {
  for (const int size : {1, 2, 5}) {
    ThreadTeam team(size);
    EXPECT_EQ(team.size(), size);
    std::vector<int> rounds(static_cast<std::size_t>(size));
    constexpr int kRounds = 2000;
    for (int round = 0; round < kRounds; ++round) {
      team.Run([&rounds](int part) { ++rounds[static_cast<std::size_t>(part)]; });
    }
    EXPECT_EQ(rounds, std::vector<int>(static_cast<std::size_t>(size), kRounds));
  }
}

TEST(ThreadTeamTest, PartsRunAtTheSameTime) {
  constexpr int kSize = 3;
  ThreadTeam team(kSize);
  std::barrier barrier(kSize);  // would wait forever for parts that come one after another
  std::atomic<int> passed = 0;
  team.Run([&](int /*part*/) {
    barrier.arrive_and_wait();
    ++passed;
  });
  EXPECT_EQ(passed, kSize);
}

TEST(ThreadTeamTest, RangesCoverEverythingOnceAndEvenly) {
  for (const int count : {0, 1, 7, 480}) {
    for (const int parts : {1, 2, 3, 16}) {
      int next = 0;
      for (int part = 0; part < parts; ++part) {
        const PartRange range = RangeOfPart(count, part, parts);
        EXPECT_EQ(range.begin, next);
        EXPECT_LE(range.end - range.begin, count / parts + 1);
        next = range.end;
      }
      EXPECT_EQ(next, count);
    }
  }
}

}  // namespace
}  // namespace relocd
