#include "runtime/service_manager.h"

#include <unistd.h>

#include <array>
#include <chrono>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "runtime/notify_listener.h"

namespace relocd {
namespace {

using namespace std::chrono_literals;

TEST(ServiceManagerTest, DoesNothingWithoutASocket) {
  const std::array<const char*, 2> environment{"WATCHDOG_USEC=2000000", nullptr};
  ServiceManager manager = ServiceManager::FromEnvironment(environment.data());
  manager.Ready();
  manager.Watchdog();
  EXPECT_FALSE(manager.connected());
  EXPECT_EQ(manager.WatchdogPeriod(), std::nullopt);
  EXPECT_EQ(manager.delayed(), 0);
}

TEST(ServiceManagerTest, SaysEachStateInTheProtocolsWords) {
  NotifyListener listener;
  const std::array<const char*, 2> environment{listener.variable(), nullptr};
  ServiceManager manager = ServiceManager::FromEnvironment(environment.data());
  ASSERT_TRUE(manager.connected());

  manager.Ready();
  EXPECT_EQ(listener.Receive(), "READY=1\n");
  manager.Watchdog();
  EXPECT_EQ(listener.Receive(), "WATCHDOG=1\n");
  manager.ExtendTimeout(1500ms);
  EXPECT_EQ(listener.Receive(), "EXTEND_TIMEOUT_USEC=1500000\n");
  manager.Stopping();
  EXPECT_EQ(listener.Receive(), "STOPPING=1\n");
}

TEST(ServiceManagerTest, KeepsAStatusOnOneLine) {
  NotifyListener listener;
  const std::array<const char*, 2> environment{listener.variable(), nullptr};
  ServiceManager manager = ServiceManager::FromEnvironment(environment.data());
  manager.Status("camera lost\nREADY=1");
  EXPECT_EQ(listener.Receive(), "STATUS=camera lost READY=1\n");
}

TEST(ServiceManagerTest, AsksForAQuarterOfTheWatchdogsTime) {
  NotifyListener listener;
  const std::array<const char*, 3> environment{
      listener.variable(), "WATCHDOG_USEC=2000000", nullptr};
  EXPECT_EQ(ServiceManager::FromEnvironment(environment.data()).WatchdogPeriod(), 500ms);
}

TEST(ServiceManagerTest, IgnoresAWatchdogThatIsAnotherProcesss) {
  NotifyListener listener;
  const std::array<const char*, 4> others{
      listener.variable(), "WATCHDOG_USEC=2000000", "WATCHDOG_PID=1", nullptr};
  EXPECT_EQ(ServiceManager::FromEnvironment(others.data()).WatchdogPeriod(), std::nullopt);

  const std::string own_pid = "WATCHDOG_PID=" + std::to_string(::getpid());
  const std::array<const char*, 4> own{
      listener.variable(), "WATCHDOG_USEC=2000000", own_pid.c_str(), nullptr};
  EXPECT_EQ(ServiceManager::FromEnvironment(own.data()).WatchdogPeriod(), 500ms);
}

TEST(ServiceManagerTest, IgnoresASocketThatCannotBe) {
  const std::string long_path = "NOTIFY_SOCKET=/" + std::string(200, 'x');
  for (const char* variable : {"NOTIFY_SOCKET=",
                               "NOTIFY_SOCKET=@",
                               "NOTIFY_SOCKET=relative",
                               "NOTIFY_SOCKET=/nobody/listens",
                               "NOTIFY_SOCKET=vsock:2:1234",
                               long_path.c_str()}) {
    const std::array<const char*, 2> environment{variable, nullptr};
    EXPECT_FALSE(ServiceManager::FromEnvironment(environment.data()).connected()) << variable;
  }
}

TEST(ServiceManagerTest, DoesNotWaitForAManagerThatDoesNotReadAndSaysReadyLater) {
  NotifyListener listener;
  const std::array<const char*, 2> environment{listener.variable(), nullptr};
  ServiceManager manager = ServiceManager::FromEnvironment(environment.data());
  for (int i = 0; manager.delayed() == 0; ++i) {
    ASSERT_LT(i, 100'000) << "the socket's queue never filled";
    manager.Watchdog();
  }
  manager.Ready();  // finds no room
  while (listener.Receive() != "nothing") {
  }
  manager.Watchdog();
  EXPECT_EQ(listener.Receive(), "READY=1\nWATCHDOG=1\n");
}

}  // namespace
}  // namespace relocd
