#include "relocd/instance_lock.h"

#include <unistd.h>

#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.h"

namespace relocd {
namespace {

class InstanceLockTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string directory_ = folder_.path();
};

TEST_F(InstanceLockTest, RefusesASecondOneAndNamesTheFirst) {
  const auto first = InstanceLock::Take(directory_, "udpm://239.255.76.67:7667");
  ASSERT_TRUE(first) << first.error().message;
  const auto second = InstanceLock::Take(directory_, "udpm://239.255.76.67:7667");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().kind, ErrorKind::kUnavailable);
  EXPECT_THAT(second.error().message,
              testing::StartsWith("another relocd (pid " + std::to_string(::getpid()) +
                                  ") runs on udpm://239.255.76.67:7667: stop it first (kill "));
}

TEST_F(InstanceLockTest, LetsAnotherNetworkHaveItsOwn) {
  const auto first = InstanceLock::Take(directory_, "udpm://239.255.76.67:7667");
  ASSERT_TRUE(first);
  EXPECT_TRUE(InstanceLock::Take(directory_, "udpm://239.255.76.67:7700"));
}

TEST_F(InstanceLockTest, IsFreeWhenItsHolderHasEnded) {
  std::optional<InstanceLock> first;
  auto taken = InstanceLock::Take(directory_, "memq://");
  ASSERT_TRUE(taken);
  first.emplace(std::move(taken).value());
  EXPECT_FALSE(InstanceLock::Take(directory_, "memq://"));
  first.reset();
  EXPECT_TRUE(InstanceLock::Take(directory_, "memq://"));
}

TEST_F(InstanceLockTest, SaysWhichFileCannotBeMade) {
  const auto lock = InstanceLock::Take(directory_ + "/nowhere", "memq://");
  ASSERT_FALSE(lock);
  EXPECT_THAT(lock.error().message, testing::HasSubstr("opening " + directory_ + "/nowhere/"));
  EXPECT_THAT(lock.error().message, testing::HasSubstr("No such file or directory"));
}

}  // namespace
}  // namespace relocd
