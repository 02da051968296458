#include "can/can_source.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can/candump_source.h"
#include "can/socket_can_source.h"
#include "support/loopback_can.h"

namespace relocd {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string WriteTemporary(const std::string& name, const std::string& text) {
  const std::string path = testing::TempDir() + name + "." + std::to_string(::getpid());
  std::ofstream(path) << text;
  return path;
}

constexpr const char* kLog =
    "(10.000000) can0 0AA#01\n"
    "(10.000000) can1 0AA#02\n"
    "(10.010000) can0 0AB#03\n"
    "(10.020000) can0 0AA#04\n"
    "(13.000000) can0 0AA#05\n";

CanConfig LogConfig(const std::string& path) {
  return {.source = "candump", .interface = "can0", .path = path, .playback_start_s = 10.0};
}

TEST(CandumpSourceTest, GivesTheWantedFramesAtTheirTimeAfterTheEpoch) {
  const MonotonicTime epoch = MonotonicClock::now() - std::chrono::milliseconds(100);
  CandumpSource source(LogConfig(WriteTemporary("wanted.log", kLog)), {{.value = 0xAA}}, epoch);
  ASSERT_TRUE(source.Open());

  const auto first = source.Receive();
  ASSERT_TRUE(first && first->has_value());
  EXPECT_THAT((*first)->payload(), ElementsAre(1));
  EXPECT_EQ((*first)->receive_time, epoch);
  const auto second = source.Receive();
  ASSERT_TRUE(second && second->has_value());
  EXPECT_EQ((*second)->receive_time, epoch + std::chrono::milliseconds(20));

  const auto third = source.Receive();  // due in 2.9 s
  ASSERT_TRUE(third);
  EXPECT_FALSE(third->has_value());
  EXPECT_FALSE(source.ended());
  EXPECT_EQ(source.status().received, 2);
}

TEST(CandumpSourceTest, ResumesInTheMiddleWhenItIsOpenedLate) {
  const MonotonicTime epoch = MonotonicClock::now() - std::chrono::seconds(3);
  CandumpSource source(LogConfig(WriteTemporary("late.log", kLog)), {}, epoch);
  ASSERT_TRUE(source.Open());
  const auto frame = source.Receive();
  ASSERT_TRUE(frame && frame->has_value());
  EXPECT_THAT((*frame)->payload(), ElementsAre(5));
  EXPECT_TRUE(source.ended());
  const auto after = source.Receive();
  ASSERT_TRUE(after);
  EXPECT_FALSE(after->has_value());
}

TEST(CandumpSourceTest, SaysWhichLineIsNone) {
  const std::string path = WriteTemporary("broken.log", "(10.0) can0 0AA#01\n(10.1) can0 0AA#0\n");
  CandumpSource source(LogConfig(path), {}, MonotonicClock::now());
  const auto opened = source.Open();
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(opened.error().message,
            path + ": line 2: data '0', must be pairs of hexadecimal digits");
  EXPECT_FALSE(source.is_open());
}

TEST(CandumpSourceTest, CountsALastLineThatIsCutOff) {
  const auto path = WriteTemporary("cut.log", "(1.0) can0 0AA#01\n(1.1) can0 0A");
  CandumpSource source(LogConfig(path), {}, MonotonicClock::now());
  ASSERT_TRUE(source.Open());
  ASSERT_TRUE(source.Receive());
  EXPECT_EQ(source.status().malformed, 1);
}

TEST(CandumpSourceTest, RefusesToWaitForAnotherClock) {
  CanConfig config = LogConfig(WriteTemporary("clock.log", "(46408.58) can0 0AA#01\n"));
  config.playback_start_s = 0.0;
  CandumpSource source(config, {}, MonotonicClock::now());
  const auto opened = source.Open();
  ASSERT_FALSE(opened);
  EXPECT_THAT(opened.error().message,
              HasSubstr("is due in 46409 s, playback_start_s must be near the recording's first"));
}

TEST(CandumpSourceTest, SaysThatItsFileIsMissing) {
  CandumpSource source(LogConfig("/no/such.log"), {}, MonotonicClock::now());
  EXPECT_EQ(source.Open().error().message, "opening /no/such.log: No such file or directory");
}

TEST(SocketCanSourceTest, CanBeOpenedAgainAndKeepsItsCounts) {
  LoopbackCan bus;
  LoopbackCan next_bus;
  int opened = 0;
  SocketCanSource source("test bus", [&]() -> Result<CanSocket> {
    return ++opened == 1 ? bus.TakeReceiver() : next_bus.TakeReceiver();
  });
  EXPECT_FALSE(source.is_open());
  ASSERT_TRUE(source.Open());
  bus.Send(0x1A0, {1});
  ASSERT_TRUE(source.Receive());
  bus.Close();

  const auto lost = source.Receive();
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().message, "test bus: receiving from the CAN bus: the peer closed");
  EXPECT_FALSE(source.is_open());
  EXPECT_EQ(source.status().state, CanBusState::kInterfaceDown);

  ASSERT_TRUE(source.Open());
  next_bus.Send(0x1A0, {2});
  const auto frame = source.Receive();
  ASSERT_TRUE(frame && frame->has_value());
  EXPECT_EQ(source.status().received, 2);
  EXPECT_EQ(source.status().state, CanBusState::kActive);
}

TEST(MakeCanSourceTest, ConnectsToAUnixSocket) {
  const std::string path = testing::TempDir() + "can." + std::to_string(::getpid());
  ::unlink(path.c_str());
  const auto source = MakeCanSource({.source = "unix", .path = path}, {}, {});
  EXPECT_EQ(source->Open().error().kind, ErrorKind::kUnavailable);

  const UniqueFd listener(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::copy(path.begin(), path.end(), static_cast<char*>(address.sun_path));
  ASSERT_EQ(::bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)),
            0);
  ASSERT_EQ(::listen(listener.get(), 1), 0);
  ASSERT_TRUE(source->Open());
  const UniqueFd peer(::accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC));
  can_frame raw{};
  raw.can_id = 0x42;
  ASSERT_EQ(::send(peer.get(), &raw, sizeof(raw), 0), static_cast<ssize_t>(sizeof(raw)));
  const auto frame = source->Receive();
  ASSERT_TRUE(frame && frame->has_value());
  EXPECT_EQ((*frame)->id.value, 0x42U);
  ::unlink(path.c_str());
}

TEST(MakeCanSourceTest, TakesOverAnInheritedSocketOnce) {
  std::array<int, 2> fds{-1, -1};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET, 0, fds.data()), 0);
  UniqueFd peer(fds[1]);
  const auto source = MakeCanSource({.source = "fd", .fd = fds[0]}, {}, {});
  ASSERT_TRUE(source->Open());
  const auto frame = source->Receive();  // does not block
  ASSERT_TRUE(frame);
  EXPECT_FALSE(frame->has_value());
  peer = UniqueFd();
  EXPECT_FALSE(source->Receive());
  EXPECT_EQ(source->Open().error().kind, ErrorKind::kUnavailable);
}

TEST(MakeCanSourceTest, NamesAFileDescriptorThatIsNone) {
  const auto source = MakeCanSource({.source = "fd", .fd = 998}, {}, {});
  const auto opened = source->Open();
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(opened.error().message, "file descriptor 998: Bad file descriptor");
}

}  // namespace
}  // namespace relocd
