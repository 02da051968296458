#include "supervision/notify_server.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/random.h"

namespace relocd {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

Notification Parsed(std::string_view datagram) {
  auto notification = ParseNotification(datagram);
  EXPECT_TRUE(notification) << notification.error().message;
  return notification ? *notification : Notification{};
}

TEST(ParseNotificationTest, ReadsEachField) {
  EXPECT_EQ(Parsed("READY=1\n"), Notification{.ready = true});
  EXPECT_EQ(Parsed("STOPPING=1"), Notification{.stopping = true});
  EXPECT_EQ(Parsed("WATCHDOG=1"), Notification{.alive = true});
  EXPECT_EQ(Parsed("WATCHDOG=trigger"), Notification{.hung = true});
  EXPECT_EQ(Parsed("EXTEND_TIMEOUT_USEC=2500000"), Notification{.extend_timeout = 2500ms});
  EXPECT_EQ(Parsed("STATUS=map loaded, 12 regions\n").status, "map loaded, 12 regions");
}

TEST(ParseNotificationTest, ReadsManyFieldsAndPassesOverTheOthers) {
  const Notification notification = Parsed("READY=1\n\nMAINPID=17\nSTATUS=a=b\nX_Y=\nWATCHDOG=1\n");
  EXPECT_TRUE(notification.ready);
  EXPECT_TRUE(notification.alive);
  EXPECT_EQ(notification.status, "a=b");
}

TEST(ParseNotificationTest, TakesTheLongestExtensionForWhatIsBeyondIt) {
  EXPECT_GT(*Parsed("EXTEND_TIMEOUT_USEC=9223372036854775807").extend_timeout, 1h);
}

TEST(ParseNotificationTest, KeepsTheStatusPrintableAndShort) {
  EXPECT_EQ(Parsed(std::string_view("STATUS=a\x1b[31m\0b\xff", 13)).status, "a?[31m");
  EXPECT_EQ(Parsed("STATUS=" + std::string(1000, 'x')).status->size(), 200U);
}

struct BadDatagram {
  std::string name;
  std::string bytes;
  std::string message;
};
class BadDatagramTest : public testing::TestWithParam<BadDatagram> {};

TEST_P(BadDatagramTest, IsRefusedWithTheReason) {
  const auto notification = ParseNotification(GetParam().bytes);
  ASSERT_FALSE(notification);
  EXPECT_THAT(notification.error().message, HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Table,
    BadDatagramTest,
    testing::Values(
        BadDatagram{"ReadyZero", "READY=0", "READY is '0', must be 1"},
        BadDatagram{"NoEquals", "READY", "line is 'READY', must be KEY=value"},
        BadDatagram{"NoKey", "=1", "line is '=1', must be KEY=value"},
        BadDatagram{"WatchdogTwo", "WATCHDOG=2", "WATCHDOG is '2', must be 1 or trigger"},
        BadDatagram{"NoNumber", "EXTEND_TIMEOUT_USEC=1e6", "must be a number of us >= 0"},
        BadDatagram{"Negative", "EXTEND_TIMEOUT_USEC=-1", "must be a number of us >= 0"},
        BadDatagram{"Overflow", "EXTEND_TIMEOUT_USEC=99999999999999999999", "must be a number"},
        BadDatagram{"TooLong", std::string(4097, 'x'), "has 4097 bytes, must have at most 4096"}),
    [](const auto& instance) { return instance.param.name; });

TEST(ParseNotificationTest, SurvivesMutatedDatagrams) {
  const std::string valid =
      "READY=1\nSTATUS=ok 30.0 Hz\nWATCHDOG=1\nEXTEND_TIMEOUT_USEC=1000000\nSTOPPING=1\n";
  TestRandom random(7);
  int accepted = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string bytes = valid.substr(0, static_cast<std::size_t>(random.Uniform(0.0, 80.0)));
    const int changes = static_cast<int>(random.Uniform(0.0, 6.0));
    for (int change = 0; change < changes && !bytes.empty(); ++change) {
      const double at = random.Uniform(0.0, static_cast<double>(bytes.size()) - 0.5);
      bytes[static_cast<std::size_t>(at)] = static_cast<char>(random.Uniform(-128.0, 127.0));
    }
    const auto notification = ParseNotification(bytes);
    if (!notification) continue;
    ++accepted;
    if (notification->status) {
      for (const char c : *notification->status)
        ASSERT_TRUE(c >= ' ' && c <= '~');
    }
  }
  EXPECT_GT(accepted, 1000);
}

/// Sends to `address`, as sd_notify(3) would.
void SendTo(const std::string& address, std::string_view bytes) {
  const UniqueFd fd(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  std::memcpy(&name.sun_path[0], address.data(), address.size());
  name.sun_path[0] = '\0';
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address.size());
  const auto* generic = reinterpret_cast<const sockaddr*>(&name);
  EXPECT_EQ(::sendto(fd.get(), bytes.data(), bytes.size(), 0, generic, size),
            static_cast<ssize_t>(bytes.size()));
}

TEST(NotifyServerTest, HearsTheProcessItAskedFor) {
  auto server = NotifyServer::Open();
  ASSERT_TRUE(server);
  EXPECT_EQ(server->Receive(::getpid()), std::nullopt);
  SendTo(server->address(), "READY=1");
  SendTo(server->address(), "WATCHDOG=1");
  EXPECT_EQ(server->Receive(::getpid()), Notification{.ready = true});
  EXPECT_EQ(server->Receive(::getpid()), Notification{.alive = true});
  EXPECT_EQ(server->Receive(::getpid()), std::nullopt);
  EXPECT_EQ(server->refused(), 0);
}

TEST(NotifyServerTest, DropsWhatAnotherProcessSends) {
  auto server = NotifyServer::Open();
  ASSERT_TRUE(server);
  const pid_t stranger = ::fork();
  if (stranger == 0) {
    SendTo(server->address(), "READY=1");
    ::_exit(0);
  }
  ::waitpid(stranger, nullptr, 0);
  EXPECT_EQ(server->Receive(::getpid()), std::nullopt);
  EXPECT_EQ(server->refused(), 1);
}

TEST(NotifyServerTest, DropsWhatDoesNotParseAndGoesOn) {
  auto server = NotifyServer::Open();
  ASSERT_TRUE(server);
  SendTo(server->address(), "READY=maybe");
  SendTo(server->address(), std::string(5000, 'x'));
  SendTo(server->address(), "READY=1");
  EXPECT_EQ(server->Receive(::getpid()), Notification{.ready = true});
  EXPECT_EQ(server->refused(), 2);
}

TEST(NotifyServerTest, TakesNoFileDescriptors) {
  auto server = NotifyServer::Open();
  ASSERT_TRUE(server);
  const UniqueFd before(::dup(0));  // the next number would be the received one's
  const UniqueFd sender(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  std::memcpy(&name.sun_path[0], server->address().data(), server->address().size());
  name.sun_path[0] = '\0';
  std::string text = "FDSTORE=1";
  iovec part{.iov_base = text.data(), .iov_len = text.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr header{};
  header.msg_name = &name;
  header.msg_namelen =
      static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + server->address().size());
  header.msg_iov = &part;
  header.msg_iovlen = 1;
  header.msg_control = control.data();
  header.msg_controllen = control.size();
  cmsghdr* rights = CMSG_FIRSTHDR(&header);
  rights->cmsg_level = SOL_SOCKET;
  rights->cmsg_type = SCM_RIGHTS;
  rights->cmsg_len = CMSG_LEN(sizeof(int));
  const int passed = sender.get();
  std::memcpy(CMSG_DATA(rights), &passed, sizeof(passed));
  ASSERT_GT(::sendmsg(sender.get(), &header, 0), 0);

  EXPECT_EQ(server->Receive(::getpid()), Notification{});
  const UniqueFd after(::dup(0));
  EXPECT_EQ(after.get(), sender.get() + 1) << "a descriptor leaked in";
}

}  // namespace
}  // namespace relocd
