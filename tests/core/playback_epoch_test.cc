#include "core/playback_epoch.h"

#include <gtest/gtest.h>
#include <stdlib.h>

namespace relocd {
namespace {

constexpr const char* kVariable = "RELOCD_PLAYBACK_EPOCH_NS";

TEST(PlaybackEpochTest, IsTheSupervisorsOrNow) {
  const MonotonicTime now = FromNanoseconds(77);
  ::unsetenv(kVariable);  // NOLINT(concurrency-mt-unsafe): the test has one thread
  EXPECT_EQ(PlaybackEpoch(now), now);
  ::setenv(kVariable, "123456789", 1);  // NOLINT(concurrency-mt-unsafe)
  EXPECT_EQ(PlaybackEpoch(now), FromNanoseconds(123456789));
  ::setenv(kVariable, "soon", 1);  // NOLINT(concurrency-mt-unsafe)
  EXPECT_EQ(PlaybackEpoch(now), now);
  ::unsetenv(kVariable);  // NOLINT(concurrency-mt-unsafe)
}

}  // namespace
}  // namespace relocd
