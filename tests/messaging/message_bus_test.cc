#include "messaging/message_bus.h"

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "messaging/image_metadata.h"
#include "messaging/in_process_bus.h"
#include "messaging/lcm_bus.h"

namespace relocd {
namespace {

using testing::ElementsAre;

using MakeBus = std::function<std::unique_ptr<MessageBus>()>;

struct BusCase {
  std::string name;
  MakeBus make;
};

/// What every back end does.
class MessageBusTest : public testing::TestWithParam<BusCase> {
 protected:
  /// memq's messages come one a call.
  void HandleAll() {
    while (bus_->HandlePending() > 0) {
    }
  }
  void PublishOdometry(std::int64_t seq) {
    odometry_t message{};
    message.seq = seq;
    message.run_id = 3;
    EXPECT_TRUE(bus_->Publish(channels::kOdometry, message));
  }

  std::unique_ptr<MessageBus> bus_ = GetParam().make();
};

TEST_P(MessageBusTest, ListensOnceSomethingIsSubscribedTo) {
  PublishOdometry(0);
  EXPECT_FALSE(bus_->is_listening());
  bus_->Subscribe<odometry_t>(channels::kOdometry, Delivery::kEvery, [](const odometry_t&) {});
  EXPECT_TRUE(bus_->is_listening());
}

TEST_P(MessageBusTest, HandsOnEveryMessageInOrder) {
  std::vector<std::int64_t> seqs;
  bus_->Subscribe<odometry_t>(channels::kOdometry,
                              Delivery::kEvery,
                              [&](const odometry_t& message) { seqs.push_back(message.seq); });
  for (const int seq : {0, 1, 2})
    PublishOdometry(seq);
  EXPECT_TRUE(seqs.empty());
  HandleAll();
  EXPECT_THAT(seqs, ElementsAre(0, 1, 2));
}

TEST_P(MessageBusTest, CountsWhatDoesNotDecodeAndGoesOn) {
  int handled = 0;
  bus_->Subscribe<odometry_t>(
      channels::kOdometry, Delivery::kEvery, [&](const odometry_t&) { ++handled; });
  const std::vector<std::uint8_t> garbage(20, 0xFF);
  EXPECT_TRUE(bus_->PublishBytes("ODOMETRY", garbage));
  PublishOdometry(0);
  HandleAll();
  EXPECT_EQ(handled, 1);
  EXPECT_EQ(bus_->counters().at("ODOMETRY").undecodable, 1);
  EXPECT_EQ(bus_->counters().at("ODOMETRY").received, 2);
}

TEST_P(MessageBusTest, CountsGapsAlsoInWhatIsSuperseded) {
  bus_->Subscribe<odometry_t>(channels::kOdometry, Delivery::kNewest, [](const odometry_t&) {});
  for (const int seq : {0, 1, 5, 6})
    PublishOdometry(seq);
  HandleAll();
  EXPECT_EQ(bus_->counters().at("ODOMETRY").stream.lost, 3);
}

TEST_P(MessageBusTest, HandsRawBytesToAPrefix) {
  std::vector<std::string> channels_seen;
  bus_->SubscribeRaw("STATUS_.*",
                     [&](const std::string& channel, std::span<const std::uint8_t> bytes) {
                       channels_seen.push_back(channel + ":" + std::to_string(bytes.size()));
                     });
  EXPECT_TRUE(bus_->PublishBytes("STATUS_a", std::vector<std::uint8_t>(3)));
  EXPECT_TRUE(bus_->PublishBytes("STATE", std::vector<std::uint8_t>(4)));
  EXPECT_TRUE(bus_->PublishBytes("STATUS_b", std::vector<std::uint8_t>(5)));
  HandleAll();
  EXPECT_THAT(channels_seen, ElementsAre("STATUS_a:3", "STATUS_b:5"));
}

TEST_P(MessageBusTest, AHandlerMayPublish) {
  int poses = 0;
  bus_->Subscribe<odometry_t>(channels::kOdometry, Delivery::kEvery, [this](const odometry_t&) {
    EXPECT_TRUE(bus_->Publish(channels::kPose, pose_t{}));
  });
  bus_->Subscribe<pose_t>(channels::kPose, Delivery::kEvery, [&](const pose_t&) { ++poses; });
  PublishOdometry(0);
  PublishOdometry(1);
  HandleAll();
  EXPECT_EQ(poses, 2);
}

INSTANTIATE_TEST_SUITE_P(
    BackEnds,
    MessageBusTest,
    testing::Values(BusCase{"InProcess", [] { return std::make_unique<InProcessBus>(); }},
                    BusCase{"LcmMemq",
                            []() -> std::unique_ptr<MessageBus> {
                              return std::move(LcmBus::Open("memq://")).value();
                            }}),
    [](const testing::TestParamInfo<BusCase>& instance) { return instance.param.name; });

TEST(InProcessBusTest, HandsTheNewestOnAfterAllThatWaits) {
  InProcessBus bus;
  std::vector<std::int64_t> seqs;
  bus.Subscribe<odometry_t>(channels::kOdometry, Delivery::kNewest, [&](const odometry_t& message) {
    seqs.push_back(message.seq);
  });
  for (int seq = 0; seq < 5; ++seq) {
    odometry_t message{};
    message.seq = seq;
    EXPECT_TRUE(bus.Publish(channels::kOdometry, message));
  }
  bus.HandlePending();
  EXPECT_THAT(seqs, ElementsAre(4));
  EXPECT_EQ(bus.counters().at("ODOMETRY").superseded, 4);
}

TEST(MessageBusPositionTest, ReadsAnImagesPositionFromItsMetadata) {
  image_t image{};
  EXPECT_FALSE(PositionOf(image).has_value());
  SetImageMetadata({.mono_ns = 1, .seq = 258, .run_id = 259}, image);
  const auto position = PositionOf(image);
  ASSERT_TRUE(position.has_value());
  EXPECT_EQ(position->seq, 258);
  EXPECT_EQ(position->run_id, 259);
}

}  // namespace
}  // namespace relocd
