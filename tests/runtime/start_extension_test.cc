#include "runtime/start_extension.h"

#include <array>
#include <chrono>

#include <gtest/gtest.h>

#include "runtime/notify_listener.h"

namespace relocd {
namespace {

using namespace std::chrono_literals;

TEST(StartExtensionTest, AsksForTheWholeTimeoutAgainTenTimesInIt) {
  NotifyListener listener;
  const std::array<const char*, 2> environment{listener.variable(), nullptr};
  ServiceManager manager = ServiceManager::FromEnvironment(environment.data());
  StartExtension extension(manager, 10s);
  const MonotonicTime start{1000s};

  extension.Step(start);
  EXPECT_EQ(listener.Receive(), "EXTEND_TIMEOUT_USEC=10000000\n");
  extension.Step(start + 999ms);
  EXPECT_EQ(listener.Receive(), "nothing");
  extension.Step(start + 1s);
  EXPECT_EQ(listener.Receive(), "EXTEND_TIMEOUT_USEC=10000000\n");
}

}  // namespace
}  // namespace relocd
