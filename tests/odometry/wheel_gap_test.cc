#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "can/signal.h"
#include "geometry/covariance.h"
#include "odometry/wheel_odometry.h"
#include "support/random.h"
#include "support/wheel_ticks_frame.h"

// What odometry makes of missing frames, on drives whose truth is known.

namespace relocd {
namespace {

constexpr std::int64_t kPeriodNs = 10'000'000;
constexpr double kTrackM = 0.5;
constexpr double kMostAcceleration = 1.0;  // m/s^2

constexpr const char* kSpeedsDbc =
    "BO_ 1 SPEEDS: 4 X\n"
    " SG_ LEFT : 0|16@1- (0.0001,0) [0|0] \"m/s\" X\n"
    " SG_ RIGHT : 16|16@1- (0.0001,0) [0|0] \"m/s\" X\n";

/// A wheel that speeds up and slows down.
struct Wheel {
  double mean_mps = 0.0;
  double swing_mps = 0.0;
  double radps = 1.0;  ///< Of the swing.
  double phase_rad = 0.0;

  static Wheel Draw(TestRandom& random, double mean_mps, double most_acceleration) {
    const double radps = random.Uniform(0.5, 20.0);
    return {.mean_mps = mean_mps,
            .swing_mps = random.Uniform(0.0, most_acceleration) / radps,
            .radps = radps,
            .phase_rad = random.Uniform(0.0, 2.0 * std::numbers::pi)};
  }
  [[nodiscard]] double Speed(double t_s) const {
    return mean_mps + swing_mps * std::sin(radps * t_s + phase_rad);
  }
  [[nodiscard]] double Travel(double t_s) const {
    return mean_mps * t_s -
           swing_mps / radps * (std::cos(radps * t_s + phase_rad) - std::cos(phase_rad));
  }
};

struct GapCase {
  const char* name;
  bool are_ticks;
};

/// A body on two wheels with 1 mm a tick or 0.1 mm/s a step, and the odometry under test, whose
/// wheels are taken to measure well: what a gap costs must come from the gap.
class GapDrive {
 public:
  GapDrive(bool are_ticks, unsigned seed, double most_acceleration = kMostAcceleration)
      : random_(seed),
        are_ticks_(are_ticks),
        dbc_(DbcFile::Parse(are_ticks ? kWheelTicksDbc : kSpeedsDbc, "v.dbc").value()),
        odometry_(WheelOdometry::Create(Config(are_ticks), dbc_).value()) {
    const double mean_mps = random_.Uniform(0.0, 2.0);
    const double turn_mps = random_.Uniform(-0.2, 0.2);
    left_ = Wheel::Draw(random_, mean_mps - turn_mps, most_acceleration);
    right_ = Wheel::Draw(random_, mean_mps + turn_mps, most_acceleration);
  }

  static OdometryConfig Config(bool are_ticks) {
    OdometryConfig config;
    if (are_ticks) {
      config.wheels.counter_signal = "WHEEL_TICKS.COUNTER";
      config.wheels.checksum_signal = "WHEEL_TICKS.CHECKSUM";
      config.wheels.checksum_rule = "crc8_j1850";
    } else {
      config.wheels.kind = "speed";
      config.wheels.left_signal = "SPEEDS.LEFT";
      config.wheels.right_signal = "SPEEDS.RIGHT";
    }
    config.drive.left_radius_m = config.drive.right_radius_m = 0.5 / std::numbers::pi;
    config.drive.ticks_per_revolution = 1000;
    config.drive.track_m = kTrackM;
    config.drive.wheel_sigma_m_per_sqrt_m = 1e-3;
    config.drive.turn_sigma_rad_per_sqrt_rad = 0.0;
    config.unknown_acceleration_mps2 = kMostAcceleration;
    return config;
  }

  /// Drives on for one period, and hands its frame on.
  std::optional<OdometryIncrement> Drive() {
    Skip(1);
    return odometry_.Handle(are_ticks_ ? TicksFrame() : SpeedsFrame());
  }

  /// Drives on for so many periods whose frames are lost.
  void Skip(int frames) {
    constexpr int kSteps = 20;
    for (int i = 0; i < frames * kSteps; ++i) {
      const double before_s = t_s();
      time_ns_ += kPeriodNs / kSteps;
      const double left = left_.Travel(t_s()) - left_.Travel(before_s);
      const double right = right_.Travel(t_s()) - right_.Travel(before_s);
      X_OB_ = X_OB_ * Pose2::Exp({0.5 * (left + right), 0.0, (right - left) / kTrackM});
    }
    count_ += static_cast<std::uint64_t>(frames);
  }

  /// The first frame after a gap that is not refused: when the frame counter has gone round, it
  /// stands where it stood, and its frame is taken for a repeated one.
  std::optional<OdometryIncrement> DriveAfterGap() {
    auto increment = Drive();
    return increment ? increment : Drive();
  }

  /// What happens to frames from 21 on is what is looked at: the odometry knows the speeds then.
  void SettleIn() {
    for (int i = 0; i < 20; ++i)
      Drive();
  }

  TestRandom& random() { return random_; }
  WheelOdometry& odometry() { return odometry_; }
  [[nodiscard]] const Pose2& X_OB() const { return X_OB_; }
  [[nodiscard]] MonotonicTime Now() const { return FromNanoseconds(time_ns_); }

 private:
  [[nodiscard]] double t_s() const { return 1e-9 * static_cast<double>(time_ns_); }

  [[nodiscard]] CanFrame TicksFrame() const {
    const auto ticks = [this](const Wheel& wheel) {
      // Counters begin anywhere, and go round.
      return static_cast<std::uint64_t>(60'000 + std::llround(1e3 * wheel.Travel(t_s()))) & 0xFFFFU;
    };
    return WheelTicksFrame(dbc_,
                           {.time_ns = time_ns_,
                            .left = ticks(left_),
                            .right = ticks(right_),
                            .count = count_ & 0xFU});
  }

  [[nodiscard]] CanFrame SpeedsFrame() const {
    const DbcMessage& message = dbc_.messages().front();
    CanFrame frame;
    frame.id = message.id;
    frame.size = static_cast<std::uint8_t>(message.size);
    frame.receive_time = Now();
    EXPECT_TRUE(EncodeSignal(message.signals[0], left_.Speed(t_s()), frame.payload()));
    EXPECT_TRUE(EncodeSignal(message.signals[1], right_.Speed(t_s()), frame.payload()));
    return frame;
  }

  TestRandom random_;
  bool are_ticks_;
  DbcFile dbc_;
  WheelOdometry odometry_;
  Wheel left_;
  Wheel right_;
  std::int64_t time_ns_ = 0;
  std::uint64_t count_ = 0;
  Pose2 X_OB_;
};

double SquaredError(const OdometryIncrement& increment, const Pose2& X_BiBj) {
  const Eigen::Vector3d error = (increment.X_BiBj.Inverse() * X_BiBj).Log();
  return SquaredMahalanobis<3>(error, increment.covariance);
}

class WheelGapTest : public testing::TestWithParam<GapCase> {};

/// Of 5 to 18 frames, which is longer than what is regular, and shorter than what is stale.
TEST_P(WheelGapTest, ABridgedGapIsOffByNoMoreThanItsCovarianceSays) {
  constexpr unsigned kDraws = 500;
  int inside = 0;
  for (unsigned seed = 0; seed < kDraws; ++seed) {
    GapDrive drive(GetParam().are_ticks, seed);
    drive.SettleIn();
    const Pose2 before = drive.X_OB();
    const int lost = drive.random().Integer(5, 18);
    drive.Skip(lost);
    EXPECT_FALSE(drive.odometry().Tick(drive.Now())) << "too early for a guess";
    const auto bridge = drive.DriveAfterGap();
    ASSERT_TRUE(bridge);
    ASSERT_NE(bridge->flags & kOdometryGap, 0);
    ASSERT_EQ(bridge->flags & (kOdometryStale | kOdometryJump | kOdometrySlip), 0);
    ASSERT_GE((bridge->time - bridge->previous_time).count(), (lost + 1) * kPeriodNs);
    ASSERT_TRUE(IsCovariance(bridge->covariance));
    const double squared = SquaredError(*bridge, before.Inverse() * drive.X_OB());
    ASSERT_LT(squared, 25.0) << "seed " << seed << ", " << lost << " frames lost";
    if (squared < kChiSquared95Dof3) ++inside;
  }
  EXPECT_GT(inside, 0.95 * kDraws);
}

TEST_P(WheelGapTest, TheLongerTheGapTheWiderTheCovariance) {
  constexpr unsigned kDraws = 100;
  for (unsigned seed = 0; seed < kDraws; ++seed) {
    Eigen::Vector3d before = Eigen::Vector3d::Zero();
    for (const int lost : {0, 1, 2, 5, 10, 18}) {
      GapDrive drive(GetParam().are_ticks, seed, 0.0);  // the same drive again, and steady
      drive.SettleIn();
      drive.Skip(lost);
      const auto bridge = drive.DriveAfterGap();
      ASSERT_TRUE(bridge);
      const Eigen::Vector3d variances = bridge->covariance.diagonal();
      for (int i = 0; i < 3; ++i)
        ASSERT_GT(variances[i], before[i]) << "seed " << seed << ", " << lost << " lost, " << i;
      before = variances;
    }
  }
}

TEST_P(WheelGapTest, AfterAGapAllIsAsBefore) {
  GapDrive drive(GetParam().are_ticks, 7);
  drive.SettleIn();
  const auto regular = drive.Drive();
  drive.Skip(10);
  drive.Drive();
  const auto next = drive.Drive();
  ASSERT_TRUE(regular && next);
  EXPECT_EQ(next->flags, 0);
  EXPECT_LT(next->covariance.trace(), 2.0 * regular->covariance.trace());
  EXPECT_EQ(drive.odometry().counters().gaps, 1);
}

/// What is missing for longer is not bridged: guesses say meanwhile that nothing is known, and the
/// first measurement takes back what they had wrong.
TEST_P(WheelGapTest, TooLongAGapIsNotBridgedAndSaysSo) {
  constexpr unsigned kDraws = 300;
  for (unsigned seed = 0; seed < kDraws; ++seed) {
    GapDrive drive(GetParam().are_ticks, seed);
    drive.SettleIn();
    const Pose2 before = drive.X_OB();
    Pose2 guessed;
    double variance = 0.0;
    const int tenths = drive.random().Integer(1, 20);
    for (int i = 0; i < tenths; ++i) {
      drive.Skip(i == 0 ? 21 : 10);
      const auto guess = drive.odometry().Tick(drive.Now());
      ASSERT_TRUE(guess);
      ASSERT_EQ(guess->flags, kOdometryStale);
      if (i > 0) {
        ASSERT_GT(guess->covariance(0, 0), variance);
        variance = guess->covariance(0, 0);
      }
      ASSERT_TRUE(IsCovariance(guess->covariance));
      guessed = guessed * guess->X_BiBj;
    }
    const auto found = drive.DriveAfterGap();
    ASSERT_TRUE(found);
    ASSERT_NE(found->flags & kOdometryGap, 0);
    const Pose2 not_guessed = guessed.Inverse() * before.Inverse() * drive.X_OB();
    ASSERT_LT(SquaredError(*found, not_guessed), 25.0) << "seed " << seed << ", " << tenths;
  }
}

INSTANTIATE_TEST_SUITE_P(Wheels,
                         WheelGapTest,
                         testing::Values(GapCase{"ticks", true}, GapCase{"speeds", false}),
                         [](const testing::TestParamInfo<GapCase>& instance) {
                           return std::string(instance.param.name);
                         });

/// Ticks that may have gone round more than once in between tell nothing of the distance.
TEST(WheelGapOfTicksTest, IsNotBridgedByCountersThatMayHaveGoneRound) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    GapDrive drive(true, seed);
    drive.SettleIn();
    const Pose2 before = drive.X_OB();
    drive.Skip(drive.random().Integer(660, 3000));  // at up to 5 m/s more than 32.8 m
    const auto found = drive.DriveAfterGap();
    ASSERT_TRUE(found);
    ASSERT_NE(found->flags & kOdometryGap, 0);
    ASSERT_LT(SquaredError(*found, before.Inverse() * drive.X_OB()), 25.0) << "seed " << seed;
    ASSERT_GT(std::sqrt(found->covariance(0, 0)), 5.0) << "the counters were believed";
  }
}

}  // namespace
}  // namespace relocd
