#include "camerad/source_waiter.h"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <chrono>

#include <gtest/gtest.h>

namespace relocd {
namespace {

using std::chrono::hours;
using std::chrono::seconds;

/// Asks for what a test says.
class WishfulSource final : public FrameSource {
 public:
  Result<void> Start(MonotonicTime /*now*/) override { return {}; }
  [[nodiscard]] int fd() const override { return wished_fd; }
  [[nodiscard]] MonotonicTime NextWakeUp() const override { return wished_time; }
  std::optional<Frame> Next(MonotonicTime /*now*/) override { return std::nullopt; }

  int wished_fd = -1;
  MonotonicTime wished_time = MonotonicTime::max();
};

class SourceWaiterTest : public testing::Test {
 protected:
  void SetUp() override {
    auto waiter = SourceWaiter::Create();
    ASSERT_TRUE(waiter) << waiter.error().message;
    waiter_.emplace(std::move(waiter).value());
  }

  [[nodiscard]] bool IsReadable() const {
    pollfd poll{.fd = waiter_->fd(), .events = POLLIN, .revents = 0};
    return ::poll(&poll, 1, 0) == 1;
  }

  std::optional<SourceWaiter> waiter_;
  WishfulSource source_;
};

TEST_F(SourceWaiterTest, IsReadableOnceTheTimeHasCome) {
  ASSERT_TRUE(waiter_->Follow(source_));
  EXPECT_FALSE(IsReadable());
  source_.wished_time = MonotonicClock::now() + hours(1);
  ASSERT_TRUE(waiter_->Follow(source_));
  EXPECT_FALSE(IsReadable());
  source_.wished_time = MonotonicClock::now() - seconds(1);
  ASSERT_TRUE(waiter_->Follow(source_));
  EXPECT_TRUE(IsReadable());
  source_.wished_time = MonotonicTime::min();  // as fast as possible
  ASSERT_TRUE(waiter_->Follow(source_));
  EXPECT_TRUE(IsReadable());
  source_.wished_time = MonotonicTime::max();
  ASSERT_TRUE(waiter_->Follow(source_));
  EXPECT_FALSE(IsReadable());
}

TEST_F(SourceWaiterTest, FollowsADeviceThatIsClosedAndOpenedAgain) {
  for (int round = 0; round < 3; ++round) {
    std::array<int, 2> ends{-1, -1};
    ASSERT_EQ(::pipe(ends.data()), 0);
    source_.wished_fd = ends[0];
    ASSERT_TRUE(waiter_->Follow(source_));
    ASSERT_TRUE(waiter_->Follow(source_));
    EXPECT_FALSE(IsReadable());
    ASSERT_EQ(::write(ends[1], "x", 1), 1);
    EXPECT_TRUE(IsReadable());
    ::close(ends[0]);
    ::close(ends[1]);
    source_.wished_fd = -1;
    ASSERT_TRUE(waiter_->Follow(source_));
    EXPECT_FALSE(IsReadable());
  }
}

}  // namespace
}  // namespace relocd
