#include "messaging/lcm_bus.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <chrono>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>

#include "core/time.h"
#include "core/unique_fd.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

TEST(LcmBusTest, NamesTheCommandThatAddsAMissingRoute) {
  // A network namespace of its own has no route at all. Another thread's or test's namespace stays
  // as it is: ctest runs each test in its own process.
  if (::unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "needs the right to make a network namespace";
  const auto bus = LcmBus::Open("udpm://239.255.76.67:7667?ttl=0");
  ASSERT_FALSE(bus);
  EXPECT_EQ(bus.error().kind, ErrorKind::kUnavailable);
  EXPECT_THAT(bus.error().message, HasSubstr("no multicast route"));
  EXPECT_THAT(bus.error().message, HasSubstr("ip route add 239.255.76.0/24 dev lo"));
}

TEST(LcmBusTest, RefusesAnAddressThatIsNone) {
  const auto bus = LcmBus::Open("udpm://robot:7667");
  ASSERT_FALSE(bus);
  EXPECT_EQ(bus.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(bus.error().message, HasSubstr("'robot' is no IPv4 address"));
}

TEST(LcmBusTest, SaysThatItCannotListenWhereAnotherProgramHasThePort) {
  const UniqueFd other(::socket(AF_INET, SOCK_DGRAM, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  socklen_t size = sizeof(address);
  ASSERT_EQ(::bind(other.get(), generic, size), 0);  // the kernel chooses a port
  ASSERT_EQ(::getsockname(other.get(), generic, &size), 0);
  const auto url = fmt::format("udpm://239.255.76.67:{}?ttl=0", ntohs(address.sin_port));
  const auto bus = LcmBus::Open(url);
  if (!bus) GTEST_SKIP() << bus.error().message;  // no route
  EXPECT_TRUE((*bus)->CheckListening()) << "nothing is subscribed to";
  (*bus)->SubscribeRaw("POSE", [](const auto& /*channel*/, auto /*bytes*/) {});
  const auto listens = (*bus)->CheckListening();
  ASSERT_FALSE(listens);
  EXPECT_EQ(listens.error().kind, ErrorKind::kUnavailable);
  EXPECT_THAT(listens.error().message, HasSubstr("listening at '" + url + "': LCM cannot"));
}

TEST(LcmBusTest, MessagesThatComeAsFastAsTheyAreHandledDoNotKeepTheCaller) {
  auto bus = LcmBus::Open("memq://");
  ASSERT_TRUE(bus);
  const pose_t pose{};
  (*bus)->Subscribe<pose_t>(channels::kPose, Delivery::kEvery, [&](const pose_t& /*pose*/) {
    const MonotonicTime end = MonotonicClock::now() + std::chrono::milliseconds(1);
    while (MonotonicClock::now() < end) {
    }
    EXPECT_TRUE((*bus)->Publish(channels::kPose, pose));
  });
  ASSERT_TRUE((*bus)->Publish(channels::kPose, pose));
  const MonotonicTime begin = MonotonicClock::now();
  const int handled = (*bus)->HandlePending();
  EXPECT_LT(MonotonicClock::now() - begin, std::chrono::seconds(2));
  EXPECT_GT(handled, 0);
  EXPECT_GT((*bus)->HandlePending(), 0) << "what was left waits for the next turn";
}

TEST(LcmBusTest, RefusesAProviderThatIsNone) {
  const auto bus = LcmBus::Open("carrier-pigeon://");
  ASSERT_FALSE(bus);
  EXPECT_THAT(bus.error().message, HasSubstr("carrier-pigeon://"));
}

TEST(LcmBusTest, WritesAndReadsALogFile) {
  const TemporaryFolder temporary;
  const std::string path = temporary.path() + "/test.lcmlog";
  {
    auto bus = LcmBus::Open("file://" + path + "?mode=w");
    ASSERT_TRUE(bus) << bus.error().message;
    pose_t pose{};
    pose.utime = 42;
    EXPECT_TRUE((*bus)->Publish(channels::kPose, pose));
  }
  auto bus = LcmBus::Open("file://" + path + "?speed=0");
  ASSERT_TRUE(bus) << bus.error().message;
  std::int64_t utime = 0;
  (*bus)->Subscribe<pose_t>(
      channels::kPose, Delivery::kEvery, [&](const pose_t& pose) { utime = pose.utime; });
  for (int i = 0; i < 10000 && utime == 0; ++i)
    (*bus)->HandlePending();
  EXPECT_EQ(utime, 42);
}

}  // namespace
}  // namespace relocd
