#include "simulation/live_player.h"

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

constexpr std::int64_t kMillisecondNs = 1'000'000;
constexpr Duration kMillisecond = std::chrono::milliseconds(1);
const MonotonicTime kEpoch = FromNanoseconds(77'000 * kMillisecondNs);

/// A second of frames every 10 ms and of images every 100 ms, on a clock of the test's.
class LivePlayerTest : public testing::Test {
 protected:
  LivePlayerTest() {
    for (int i = 0; i < 100; ++i) {
      CandumpRecord record{.time_ns = i * 10 * kMillisecondNs, .interface = "can0"};
      record.frame.data[0] = static_cast<std::uint8_t>(i);
      drive_.frames.push_back(record);
    }
    for (int i = 0; i < 10; ++i)
      drive_.image_times_ns.push_back((5 + 100 * i) * kMillisecondNs);
    drive_.image = [this](std::size_t i) -> Result<std::optional<std::vector<std::uint8_t>>> {
      if (now_ < kEpoch + Duration(drive_.image_times_ns[i]) + rendering_late_) {
        return std::optional<std::vector<std::uint8_t>>();
      }
      return std::optional(std::vector<std::uint8_t>{static_cast<std::uint8_t>(i)});
    };
    outputs_.send_frame = [this](const CanFrame& frame) -> Result<void> {
      frames_.emplace_back(now_ - kEpoch, frame.data[0]);
      if (fails_at_ == std::ssize(frames_)) return Error{ErrorKind::kUnavailable, "bus is down"};
      return {};
    };
    outputs_.show_image = [this](const std::vector<std::uint8_t>& jpeg) -> Result<void> {
      images_.emplace_back(now_ - kEpoch, jpeg.at(0));
      return {};
    };
  }

  Result<void> Play() {
    player_.emplace(drive_,
                    outputs_,
                    LivePlayer::Clock{.now = [this] { return now_; },
                                      .sleep_until =
                                          [this](MonotonicTime time) {
                                            now_ = std::max(now_, time) + oversleeps_;
                                          }});
    return player_->Play(kEpoch, stop_);
  }

  LivePlayer::Drive drive_;
  LivePlayer::Outputs outputs_;
  std::optional<LivePlayer> player_;
  std::atomic<bool> stop_ = false;
  MonotonicTime now_ = kEpoch - 500 * kMillisecond;
  Duration oversleeps_{};
  Duration rendering_late_{};
  std::ptrdiff_t fails_at_ = -1;
  std::vector<std::pair<Duration, int>> frames_;
  std::vector<std::pair<Duration, int>> images_;
};

TEST_F(LivePlayerTest, EverythingLeavesWhenItIsDue) {
  ASSERT_TRUE(Play());
  ASSERT_EQ(frames_.size(), 100U);
  for (int i = 0; i < 100; ++i)
    EXPECT_EQ(frames_[static_cast<std::size_t>(i)], (std::pair{10 * i * kMillisecond, i}));
  ASSERT_EQ(images_.size(), 10U);
  for (int i = 0; i < 10; ++i)
    EXPECT_EQ(images_[static_cast<std::size_t>(i)], (std::pair{(5 + 100 * i) * kMillisecond, i}));
  EXPECT_EQ(player_->counters().late_frames, 0);
  EXPECT_EQ(player_->counters().late_images, 0);
}

TEST_F(LivePlayerTest, CountsWhatIsLate) {
  oversleeps_ = 12 * kMillisecond;
  ASSERT_TRUE(Play());
  EXPECT_EQ(frames_.size(), 100U);
  EXPECT_GT(player_->counters().late_frames, 40);
  EXPECT_EQ(player_->counters().worst_frame, 12 * kMillisecond);
}

TEST_F(LivePlayerTest, AnImageThatIsNotReadyLeavesLateAndHoldsUpNoFrame) {
  rendering_late_ = 60 * kMillisecond;
  ASSERT_TRUE(Play());
  ASSERT_EQ(images_.size(), 10U);
  EXPECT_EQ(images_[3], (std::pair{365 * kMillisecond, 3}));
  EXPECT_EQ(player_->counters().late_images, 10);
  EXPECT_EQ(player_->counters().worst_image, 60 * kMillisecond);
  EXPECT_EQ(player_->counters().late_frames, 0);
}

TEST_F(LivePlayerTest, AnImageThatIsNotThereWhenTheNextIsDueIsDropped) {
  rendering_late_ = 150 * kMillisecond;
  ASSERT_TRUE(Play());
  // The last one has no next one.
  EXPECT_EQ(player_->counters().dropped_images, 9);
  EXPECT_EQ(player_->counters().images, 1);
  EXPECT_EQ(frames_.size(), 100U);
}

TEST_F(LivePlayerTest, PlaysOnlyWhatHasAnOutput) {
  outputs_.show_image = nullptr;
  ASSERT_TRUE(Play());
  EXPECT_EQ(frames_.size(), 100U);
  EXPECT_TRUE(images_.empty());
}

TEST_F(LivePlayerTest, EndsWithTheFirstErrorOfAnOutput) {
  fails_at_ = 20;
  const auto ok = Play();
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().message, "bus is down");
  EXPECT_EQ(frames_.size(), 20U);
}

TEST_F(LivePlayerTest, StopsWhenAsked) {
  stop_ = true;
  ASSERT_TRUE(Play());
  EXPECT_TRUE(frames_.empty());
}

}  // namespace
}  // namespace relocd
