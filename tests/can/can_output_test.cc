#include "can/can_output.h"

#include <filesystem>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can/socket_can_source.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

class CanOutputTest : public testing::Test {
 protected:
  std::unique_ptr<CanOutput> Listen() {
    auto output = CanOutput::Open("unix:" + path_);
    EXPECT_TRUE(output) << output.error().message;
    return std::move(output).value();
  }
  CanSocket Connect() {
    auto socket = ConnectCanSocket(path_, {});
    EXPECT_TRUE(socket) << socket.error().message;
    return std::move(socket).value();
  }
  static CanFrame Frame(std::uint8_t first) {
    CanFrame frame;
    frame.id = {.value = 0x1A0, .extended = false};
    frame.size = 8;
    frame.data[0] = first;
    frame.data[7] = 0xFF;
    return frame;
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.path() + "/can0";
};

TEST_F(CanOutputTest, EachWhoConnectsGetsTheFrames) {
  const auto output = Listen();
  CanSocket first = Connect();
  ASSERT_TRUE(output->Send(Frame(1)));
  CanSocket second = Connect();
  ASSERT_TRUE(output->Send(Frame(2)));
  for (const std::uint8_t expected : {std::uint8_t{1}, std::uint8_t{2}}) {
    const auto received = first.Receive();
    ASSERT_TRUE(received && received->has_value());
    EXPECT_EQ((*received)->id, Frame(0).id);
    EXPECT_EQ((*received)->size, 8);
    EXPECT_EQ((*received)->data, Frame(expected).data);
  }
  EXPECT_EQ((*second.Receive())->data, Frame(2).data);
  EXPECT_FALSE(second.Receive()->has_value());
  EXPECT_EQ(output->counters().sent, 3);
}

TEST_F(CanOutputTest, CarriesLongAndExtendedFrames) {
  const auto output = Listen();
  CanSocket socket = Connect();
  CanFrame frame = Frame(7);
  frame.id = {.value = 0x1ABCDEF, .extended = true};
  frame.fd = true;
  frame.size = 48;
  frame.data[47] = 9;
  ASSERT_TRUE(output->Send(frame));
  const auto received = socket.Receive();
  ASSERT_TRUE(received && received->has_value());
  EXPECT_EQ((*received)->id, frame.id);
  EXPECT_TRUE((*received)->fd);
  EXPECT_EQ((*received)->size, 48);
  EXPECT_EQ((*received)->data, frame.data);
}

TEST_F(CanOutputTest, NobodyHasToListen) {
  const auto output = Listen();
  EXPECT_TRUE(output->Send(Frame(1)));
  { const CanSocket socket = Connect(); }
  EXPECT_TRUE(output->Send(Frame(2)));
  EXPECT_TRUE(output->Send(Frame(3)));
  CanSocket socket = Connect();
  EXPECT_TRUE(output->Send(Frame(4)));
  EXPECT_EQ((*socket.Receive())->data, Frame(4).data);
}

TEST_F(CanOutputTest, DropsWhatAReceiverDoesNotFetch) {
  const auto output = Listen();
  const CanSocket socket = Connect();
  constexpr int kMany = 20'000;
  for (int i = 0; i < kMany; ++i)
    ASSERT_TRUE(output->Send(Frame(0)));
  EXPECT_GT(output->counters().dropped, 0);
  EXPECT_EQ(output->counters().sent + output->counters().dropped, kMany);
}

TEST_F(CanOutputTest, TakesTheSocketAwayWithItself) {
  { const auto output = Listen(); }
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(CanOutputTest, TakesThePlaceOfASocketThatWasLeftBehind) {
  const std::string moved = path_ + ".moved";
  {
    const auto killed = Listen();
    std::filesystem::rename(path_, moved);
  }
  std::filesystem::rename(moved, path_);
  const auto output = Listen();
  CanSocket socket = Connect();
  EXPECT_TRUE(output->Send(Frame(1)));
  EXPECT_TRUE(socket.Receive()->has_value());
}

TEST_F(CanOutputTest, LeavesFilesAlone) {
  const std::string file = folder_.Write("file", "x");
  EXPECT_FALSE(CanOutput::Open("unix:" + file));
  EXPECT_TRUE(std::filesystem::exists(file));
}

TEST_F(CanOutputTest, NamesWhatItCannotOpen) {
  const auto output = Listen();
  EXPECT_THAT(CanOutput::Open("unix:" + path_).error().message,
              HasSubstr("making the socket " + path_));
  EXPECT_THAT(CanOutput::Open("unix:").error().message, HasSubstr("socket path '' has 0 bytes"));
  // Without CAN in the kernel the socket fails, with it the interface.
  const auto none = CanOutput::Open("nocan7");
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().message, HasSubstr("nocan7"));
  EXPECT_EQ(none.error().kind, ErrorKind::kUnavailable);
}

}  // namespace
}  // namespace relocd
