#include "odometry/wheel_odometry.h"

#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/covariance.h"
#include "support/eigen_matchers.h"
#include "support/wheel_ticks_frame.h"

namespace relocd {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kPeriodNs = 10'000'000;
constexpr std::int64_t kHourNs = 3'600'000'000'000;

/// One tick is one millimetre.
OdometryConfig TicksConfig() {
  OdometryConfig config;
  config.wheels.counter_signal = "WHEEL_TICKS.COUNTER";
  config.wheels.checksum_signal = "WHEEL_TICKS.CHECKSUM";
  config.wheels.checksum_rule = "crc8_j1850";
  config.drive.left_radius_m = 0.5 / std::numbers::pi;
  config.drive.right_radius_m = 0.5 / std::numbers::pi;
  config.drive.ticks_per_revolution = 1000;
  config.max_interval_s = 0.025;
  return config;
}

/// A robot that sends a frame every 10 ms, and the odometry under test.
class WheelOdometryTest : public testing::Test {
 protected:
  /// Drives for one period, and sends the frame.
  std::optional<OdometryIncrement> Drive(int left, int right) {
    Skip(left, right);
    return odometry_.Handle(Frame());
  }
  /// Drives for one period, without a frame.
  void Skip(int left, int right) {
    ticks_.time_ns += kPeriodNs;
    ticks_.left = (ticks_.left + static_cast<std::uint64_t>(left)) & 0xFFFFU;
    ticks_.right = (ticks_.right + static_cast<std::uint64_t>(right)) & 0xFFFFU;
    ticks_.count = (ticks_.count + 1) & 0xFU;
  }
  [[nodiscard]] CanFrame Frame() const { return WheelTicksFrame(dbc_, ticks_); }
  [[nodiscard]] MonotonicTime Now() const { return FromNanoseconds(ticks_.time_ns); }

  DbcFile dbc_ = DbcFile::Parse(kWheelTicksDbc, "v.dbc").value();
  WheelTicks ticks_{.left = 65500, .right = 100};
  WheelOdometry odometry_ = WheelOdometry::Create(TicksConfig(), dbc_).value();
};

TEST_F(WheelOdometryTest, BeginsWithoutMotion) {
  const auto first = Drive(0, 0);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->previous_time, first->time);
  EXPECT_THAT(first->X_BiBj.Log(), IsNear(Eigen::Vector3d(Eigen::Vector3d::Zero()), 0.0));
  EXPECT_EQ(first->flags, 0);
}

TEST_F(WheelOdometryTest, FollowsTheWheelsAcrossTheWrap) {
  Drive(0, 0);
  const auto second = Drive(50, 50);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->time - second->previous_time, Duration(kPeriodNs));
  EXPECT_THAT(second->X_BiBj.Log(), IsNear(Eigen::Vector3d(0.05, 0.0, 0.0), 1e-12));
  EXPECT_NEAR(second->speed_mps, 5.0, 1e-9);
  ASSERT_TRUE(second->ticks);
  EXPECT_THAT(*second->ticks, testing::ElementsAre(65550, 150));
  EXPECT_EQ(second->flags, 0);
  const auto third = Drive(-100 + 95, 5);  // turns left on the spot: 10 mm over 0.5 m
  ASSERT_TRUE(third);
  EXPECT_NEAR(third->X_BiBj.yaw(), 0.02, 1e-12);
  EXPECT_NEAR(third->yaw_rate_radps, 2.0, 1e-9);
  EXPECT_NEAR(third->X_OB.x(), 0.05, 1e-12);
}

TEST_F(WheelOdometryTest, ComposedIncrementsAreThePose) {
  std::mt19937 engine(1);
  Pose2 X_OB;
  std::optional<OdometryIncrement> last;
  for (int i = 0; i < 500; ++i) {
    if (i % 50 == 49) {
      for (int k = 0; k < 30; ++k)
        Skip(10, 12);
      odometry_.Tick(Now());
    }
    last = Drive(static_cast<int>(engine() % 40), static_cast<int>(engine() % 40));
    ASSERT_TRUE(last);
    EXPECT_TRUE(i == 0 || IsCovariance(last->covariance));
    X_OB = i % 50 == 49 ? last->X_OB : X_OB * last->X_BiBj;
    EXPECT_THAT((X_OB.Inverse() * last->X_OB).Log(),
                IsNear(Eigen::Vector3d(Eigen::Vector3d::Zero()), 1e-9));
  }
}

TEST_F(WheelOdometryTest, FlagsALostFrameAndKeepsItsTravel) {
  Drive(0, 0);
  const auto regular = Drive(10, 10);
  Skip(10, 10);
  const auto next = Drive(10, 10);
  ASSERT_TRUE(regular && next);
  EXPECT_EQ(next->flags, kOdometryGap);
  EXPECT_NEAR(next->X_BiBj.x(), 0.02, 1e-12);
  EXPECT_GT(next->covariance(1, 1), 2.0 * regular->covariance(1, 1));
}

TEST_F(WheelOdometryTest, FlagsAFrameThatIsLate) {
  Drive(0, 0);
  for (int i = 0; i < 16; ++i)  // a whole round of the frame counter
    Skip(1, 1);
  const auto next = Drive(1, 1);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->flags, kOdometryGap);
  EXPECT_NEAR(next->X_BiBj.x(), 0.017, 1e-12);
}

TEST_F(WheelOdometryTest, FlagsARefusedChecksum) {
  Drive(0, 0);
  Skip(10, 10);
  CanFrame broken = Frame();
  broken.data[1] ^= 1U;
  EXPECT_FALSE(odometry_.Handle(broken));
  const auto next = Drive(10, 10);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->flags, kOdometryChecksum | kOdometryGap);
  EXPECT_NEAR(next->X_BiBj.x(), 0.02, 1e-12);
}

TEST_F(WheelOdometryTest, RefusesAJumpAndLosesNothing) {
  Drive(0, 0);
  const std::uint64_t left = ticks_.left;
  Skip(10, 10);
  ticks_.left = (left + 5000) & 0xFFFFU;  // 5 m in 10 ms
  EXPECT_FALSE(odometry_.Handle(Frame()));
  ticks_.left = (left + 10) & 0xFFFFU;
  const auto next = Drive(10, 10);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->flags, kOdometryJump);
  EXPECT_NEAR(next->X_BiBj.x(), 0.02, 1e-12);
  EXPECT_EQ(odometry_.counters().jumps, 1);
}

TEST_F(WheelOdometryTest, GoesOnAfterTheCountersWereSetAnew) {
  Drive(0, 0);
  Drive(10, 10);
  const auto before = Drive(10, 10);
  ticks_.left = 30000;
  ticks_.right = 30000;
  EXPECT_FALSE(Drive(10, 10));
  const auto reset = Drive(10, 10);  // went on at 1 m/s for 20 ms, as far as one can know
  ASSERT_TRUE(before && reset);
  EXPECT_EQ(reset->flags, kOdometryJump);
  EXPECT_NEAR(reset->X_BiBj.x(), 0.02, 1e-12);
  EXPECT_GT(reset->covariance(2, 2), before->covariance(2, 2));
  const auto after = Drive(10, 10);
  ASSERT_TRUE(after);
  EXPECT_EQ(after->flags, 0);
  EXPECT_NEAR(after->X_BiBj.x(), 0.01, 1e-12);
}

TEST_F(WheelOdometryTest, FlagsStandstillAfterAWhile) {
  Drive(0, 0);
  Drive(10, 10);
  std::optional<OdometryIncrement> increment;
  for (int i = 0; i < 29; ++i)
    increment = Drive(0, 0);
  ASSERT_TRUE(increment);
  EXPECT_EQ(increment->flags, 0);
  increment = Drive(0, 0);
  ASSERT_TRUE(increment);
  EXPECT_EQ(increment->flags, kOdometryStandstill);
  EXPECT_TRUE(IsCovariance(increment->covariance));
  increment = Drive(1, 0);
  ASSERT_TRUE(increment);
  EXPECT_EQ(increment->flags, 0);
}

TEST_F(WheelOdometryTest, FlagsASpinningWheel) {
  Drive(0, 0);
  Drive(10, 10);
  const auto regular = Drive(10, 10);
  const auto slipping = Drive(10, 45);  // 35 mm in 10 ms over 0.5 m would be 7 rad/s, in 25 ms not
  const auto spinning = Drive(10, 120);
  ASSERT_TRUE(regular && slipping && spinning);
  EXPECT_EQ(slipping->flags & kOdometrySlip, kOdometrySlip);  // 3.5 m/s faster within 10 ms
  EXPECT_EQ(spinning->flags & kOdometrySlip, kOdometrySlip);
  EXPECT_GT(spinning->covariance(2, 2), 10.0 * regular->covariance(2, 2));
}

TEST_F(WheelOdometryTest, RefusesTimesThatDoNotIncrease) {
  Drive(0, 0);
  ticks_.count = 9;
  EXPECT_FALSE(odometry_.Handle(Frame()));
  EXPECT_EQ(odometry_.counters().out_of_order, 1);
}

TEST_F(WheelOdometryTest, AClockThatJumpsBackByHoursIsFollowed) {
  ticks_.time_ns = 3 * kHourNs;
  Drive(0, 0);
  Drive(10, 10);
  ticks_.time_ns -= 2 * kHourNs;
  for (int i = 0; i < 99; ++i)
    EXPECT_FALSE(Drive(10, 10)) << i;
  const auto anew = Drive(10, 10);
  ASSERT_TRUE(anew);
  EXPECT_EQ(anew->flags, kOdometryJump);
  EXPECT_EQ(anew->time, anew->previous_time);
  EXPECT_NEAR(anew->X_OB.x(), 0.01, 1e-12);  // what was driven meanwhile is not known
  EXPECT_TRUE(IsCovariance(anew->covariance));
  const auto next = Drive(10, 10);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->flags, 0);
  EXPECT_NEAR(next->X_OB.x(), 0.02, 1e-12);
  EXPECT_EQ(odometry_.counters().out_of_order, 100);
  EXPECT_EQ(odometry_.counters().clock_jumps, 1);
}

TEST_F(WheelOdometryTest, OneFrameFromHoursAheadDoesNotSilenceTheOthersForGood) {
  Drive(0, 0);
  Drive(10, 10);
  ticks_.time_ns += 5 * kHourNs;
  const auto ahead = Drive(10, 10);
  ASSERT_TRUE(ahead);
  EXPECT_NE(ahead->flags & kOdometryGap, 0);
  EXPECT_TRUE(IsCovariance(ahead->covariance));
  ticks_.time_ns -= 5 * kHourNs;
  int increments = 0;
  for (int i = 0; i < 150; ++i)
    increments += Drive(10, 10) ? 1 : 0;
  EXPECT_EQ(increments, 51);
  EXPECT_EQ(odometry_.counters().clock_jumps, 1);
}

TEST_F(WheelOdometryTest, OldFramesAmongNewOnesAreNoJumpOfTheClock) {
  Drive(0, 0);
  const std::int64_t old_ns = ticks_.time_ns;
  for (int i = 1; i <= 300; ++i) {
    EXPECT_TRUE(Drive(10, 10));
    WheelTicks late = ticks_;
    late.time_ns = old_ns - 1000 + i;
    late.count = (late.count + 8) & 0xFU;
    EXPECT_FALSE(odometry_.Handle(WheelTicksFrame(dbc_, late)));
    ticks_.count = late.count;
  }
  EXPECT_EQ(odometry_.counters().out_of_order, 300);
  EXPECT_EQ(odometry_.counters().clock_jumps, 0);
}

TEST_F(WheelOdometryTest, GuessesWhileNothingComesAndTakesTheErrorBack) {
  Drive(0, 0);
  Drive(10, 10);
  EXPECT_FALSE(odometry_.Tick(Now() + std::chrono::milliseconds(150)));

  // It stopped when the bus failed, which nobody knows: the guess goes on at 1 m/s, then stands.
  const MonotonicTime lost = Now();
  double variance = 0.0;
  double guessed_m = 0.0;
  for (int i = 1; i <= 15; ++i) {
    const auto guess = odometry_.Tick(lost + std::chrono::milliseconds(100 * i + 101));
    ASSERT_TRUE(guess);
    EXPECT_EQ(guess->flags, kOdometryStale);
    EXPECT_GT(guess->covariance(0, 0), variance);  // grows faster and faster
    EXPECT_TRUE(IsCovariance(guess->covariance));
    variance = guess->covariance(0, 0);
    guessed_m = guess->X_OB.x() - 0.01;
  }
  EXPECT_NEAR(guessed_m, 0.5, 1e-9);
  EXPECT_FALSE(odometry_.Tick(lost + std::chrono::milliseconds(1602)));  // not yet

  for (int i = 0; i < 170; ++i)
    Skip(0, 0);
  const auto found = Drive(2, 2);
  ASSERT_TRUE(found);
  EXPECT_NE(found->flags & kOdometryGap, 0);
  EXPECT_NEAR(found->X_OB.x(), 0.012, 1e-12);  // the counters know
  EXPECT_NEAR(found->X_BiBj.x(), -0.498, 1e-9);
  const double error_m = 0.498;
  EXPECT_GT(found->covariance(0, 0), error_m * error_m / 9.0);  // within three sigma
  const auto after = Drive(10, 10);
  ASSERT_TRUE(after);
  EXPECT_LT(after->covariance(0, 0), 1e-4);
}

TEST_F(WheelOdometryTest, TakesInFramesThatWaitedLongerThanTheGuess) {
  Drive(0, 0);
  Drive(10, 10);
  const auto guess = odometry_.Tick(Now() + std::chrono::milliseconds(300));
  ASSERT_TRUE(guess);
  EXPECT_NEAR(guess->X_BiBj.x(), 0.3, 1e-9);
  EXPECT_FALSE(Drive(10, 10));  // before the guess
  for (int i = 0; i < 30; ++i)
    Skip(10, 10);
  const auto next = Drive(10, 10);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->previous_time, guess->time);
  EXPECT_NEAR(next->X_OB.x(), 0.33, 1e-9);
}

TEST_F(WheelOdometryTest, DoesNotTrustCountersThatMayHaveGoneRound) {
  Drive(0, 0);
  for (int i = 0; i < 700; ++i)  // 7 s at up to 5 m/s are more than 32.767 m
    Skip(1, 1);
  const auto next = Drive(1, 1);
  ASSERT_TRUE(next);
  EXPECT_NE(next->flags & kOdometryGap, 0);
  EXPECT_NEAR(next->X_BiBj.x(), 0.0, 1e-12);
  EXPECT_GT(std::sqrt(next->covariance(0, 0)), 5.0);
}

TEST_F(WheelOdometryTest, SurvivesHostileFrames) {
  std::mt19937 engine(3);
  for (int i = 0; i < 5000; ++i) {
    Skip(static_cast<int>(engine() % 30), static_cast<int>(engine() % 30));
    if (engine() % 10 == 0) ticks_.left = engine() % 65536;
    if (engine() % 50 == 0) ticks_.time_ns += engine() % 3'000'000'000;
    CanFrame frame = Frame();
    if (engine() % 10 == 0) frame.size = static_cast<std::uint8_t>(engine() % 9);
    if (engine() % 10 == 0) frame.data[engine() % 8] = static_cast<std::uint8_t>(engine());
    for (const auto& increment : {odometry_.Handle(frame), odometry_.Tick(Now())}) {
      if (!increment || increment->time == increment->previous_time) continue;
      ASSERT_GT(increment->time, increment->previous_time);
      ASSERT_TRUE(IsCovariance(increment->covariance)) << increment->covariance;
      ASSERT_TRUE(increment->X_OB.Log().allFinite());
    }
  }
  EXPECT_GT(odometry_.counters().jumps, 100);
}

constexpr const char* kSpeedsDbc =
    "BO_ 1 SPEEDS: 8 X\n"
    " SG_ RL : 0|16@1- (0.01,0) [0|0] \"m/s\" X\n"
    " SG_ RR : 16|16@1- (0.01,0) [0|0] \"m/s\" X\n"
    " SG_ FL : 32|16@1- (0.01,0) [0|0] \"m/s\" X\n"
    " SG_ FR : 48|16@1- (0.01,0) [0|0] \"m/s\" X\n";

class WheelSpeedOdometryTest : public testing::Test {
 protected:
  static OdometryConfig SpeedConfig() {
    OdometryConfig config;
    config.wheels.kind = "speed";
    config.wheels.left_signal = "SPEEDS.RL";
    config.wheels.right_signal = "SPEEDS.RR";
    config.wheels.front_left_signal = "SPEEDS.FL";
    config.wheels.front_right_signal = "SPEEDS.FR";
    config.max_interval_s = 0.15;
    return config;
  }

  std::optional<OdometryIncrement> Send(double time_s, double rear, double front) {
    CanFrame frame;
    frame.id.value = 1;
    frame.size = 8;
    frame.receive_time = MonotonicTime(FromSeconds(time_s));
    for (const DbcSignal& signal : dbc_.messages()[0].signals) {
      const double speed = signal.name[0] == 'R' ? rear : front;
      EXPECT_TRUE(EncodeSignal(signal, speed, frame.payload()));
    }
    return odometry_.Handle(frame);
  }

  DbcFile dbc_ = DbcFile::Parse(kSpeedsDbc, "v.dbc").value();
  WheelOdometry odometry_ = WheelOdometry::Create(SpeedConfig(), dbc_).value();
};

TEST_F(WheelSpeedOdometryTest, IntegratesSpeedsAsTrapezoids) {
  Send(0.0, 1.0, 1.0);
  const auto next = Send(0.1, 2.0, 2.0);
  ASSERT_TRUE(next);
  EXPECT_NEAR(next->X_BiBj.x(), 0.15, 1e-12);
  EXPECT_NEAR(next->speed_mps, 2.0, 1e-12);
  EXPECT_FALSE(next->ticks);
  EXPECT_EQ(next->flags, 0);
}

TEST_F(WheelSpeedOdometryTest, InflatesTheCovarianceOfAGap) {
  Send(0.0, 1.0, 1.0);
  const auto regular = Send(0.1, 1.0, 1.0);
  const auto gap = Send(2.1, 1.0, 1.0);
  ASSERT_TRUE(regular && gap);
  EXPECT_EQ(gap->flags, kOdometryGap);
  EXPECT_GT(std::sqrt(gap->covariance(0, 0)), 0.5);
}

TEST_F(WheelSpeedOdometryTest, RefusesAnImplausibleSpeed) {
  Send(0.0, 1.0, 1.0);
  EXPECT_FALSE(Send(0.1, 6.0, 6.0));
  const auto next = Send(0.2, 1.0, 1.0);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->flags, kOdometryJump | kOdometryGap);
  EXPECT_NEAR(next->X_BiBj.x(), 0.2, 1e-12);
}

TEST_F(WheelSpeedOdometryTest, FlagsAxlesThatContradictEachOther) {
  Send(0.0, 3.0, 3.0);
  const auto regular = Send(0.1, 3.0, 2.6);
  const auto slipping = Send(0.2, 4.4, 2.5);
  ASSERT_TRUE(regular && slipping);
  EXPECT_EQ(regular->flags, 0);
  EXPECT_EQ(slipping->flags, kOdometrySlip);
}

TEST_F(WheelSpeedOdometryTest, ComparesAxlesByTheirScales) {
  OdometryConfig config = SpeedConfig();
  config.drive.front_left_scale = config.drive.front_right_scale = -0.5;
  odometry_ = WheelOdometry::Create(config, dbc_).value();
  Send(0.0, 3.0, -6.0);
  const auto regular = Send(0.1, 3.0, -6.0);
  ASSERT_TRUE(regular);
  EXPECT_EQ(regular->flags, 0);
}

TEST_F(WheelSpeedOdometryTest, FlagsStandstillOfCreepingReadings) {
  Send(0.0, 0.01, 0.0);
  Send(0.1, 0.0, 0.0);
  Send(0.2, -0.01, 0.0);
  const auto still = Send(0.3, 0.01, 0.0);
  ASSERT_TRUE(still);
  EXPECT_EQ(still->flags, kOdometryStandstill);
}

/// A car whose wheels, steering and yaw rate are in messages of their own; the yaw rate has a bias.
constexpr const char* kCarDbc =
    "BO_ 1 SPEEDS: 8 X\n"
    " SG_ RL : 0|16@1- (0.001,0) [0|0] \"m/s\" X\n"
    " SG_ RR : 16|16@1- (0.001,0) [0|0] \"m/s\" X\n"
    " SG_ FL : 32|16@1- (0.001,0) [0|0] \"m/s\" X\n"
    " SG_ FR : 48|16@1- (0.001,0) [0|0] \"m/s\" X\n"
    "BO_ 2 STEERING: 2 X\n SG_ ANGLE : 0|16@1- (0.001,0) [0|0] \"rad\" X\n"
    "BO_ 3 INERTIAL: 2 X\n SG_ YAW_RATE : 0|16@1- (0.0001,0) [0|0] \"rad/s\" X\n";

OdometryConfig CarConfig(const std::string& model) {
  OdometryConfig config{.model = model};
  config.wheels.kind = "speed";
  config.wheels.left_signal = "SPEEDS.RL";
  config.wheels.right_signal = "SPEEDS.RR";
  config.wheels.front_left_signal = "SPEEDS.FL";
  config.wheels.front_right_signal = "SPEEDS.FR";
  config.drive.track_m = 1.6;
  config.drive.wheel_sigma_m_per_sqrt_m = 0.004;
  config.steering = {.signal = "STEERING.ANGLE", .unit_rad = 1.0, .ratio = 15.0};
  config.max_speed_mps = 30.0;
  config.max_acceleration_mps2 = 1e4;  // the tests' drives change their speed at once
  return config;
}

/// Drives arcs, and gives what odometry makes of the frames.
class CarTest {
 public:
  explicit CarTest(const OdometryConfig& config)
      : config_(config),
        dbc_(DbcFile::Parse(kCarDbc, "v.dbc").value()),
        odometry_(WheelOdometry::Create(config, dbc_).value()) {}

  /// For `duration_s`; the right rear wheel turns faster by `spin_mps`.
  void Drive(double speed_mps, double yaw_rate_radps, double duration_s, double spin_mps = 0.0) {
    const double half_m = 0.5 * config_.drive.track_m;
    const double across = config_.drive.wheelbase_m * yaw_rate_radps;
    const double steering = speed_mps == 0.0 ? 0.0 : std::atan(across / speed_mps);
    for (int i = 0; i < static_cast<int>(std::lround(duration_s * 100.0)); ++i) {
      time_ns_ += kPeriodNs;
      X_WB_ = X_WB_ * Pose2::Exp({0.01 * speed_mps, 0.0, 0.01 * yaw_rate_radps});
      Send("STEERING", {15.0 * steering});
      Send("INERTIAL", {yaw_rate_radps + kBias});
      Send("SPEEDS",
           {speed_mps - half_m * yaw_rate_radps,
            speed_mps + half_m * yaw_rate_radps + spin_mps,
            std::hypot(speed_mps - half_m * yaw_rate_radps, across),
            std::hypot(speed_mps + half_m * yaw_rate_radps, across)});
    }
  }

  /// The body turns, and no wheel shows it.
  void TurnUnseen(double yaw_rate_radps, double duration_s) {
    for (int i = 0; i < static_cast<int>(std::lround(duration_s * 100.0)); ++i) {
      time_ns_ += kPeriodNs;
      Send("INERTIAL", {yaw_rate_radps + kBias});
      Send("SPEEDS", {0.0, 0.0, 0.0, 0.0});
    }
  }

  /// A frame that ends before its last byte.
  void SendCut(const std::string& name) {
    const DbcMessage& message = *dbc_.FindMessage(name).value();
    CanFrame frame;
    frame.id = message.id;
    frame.size = static_cast<std::uint8_t>(message.size - 1);
    frame.receive_time = FromNanoseconds(time_ns_);
    EXPECT_FALSE(odometry_.Handle(frame));
  }

  void JumpBack(double seconds) { time_ns_ -= static_cast<std::int64_t>(1e9 * seconds); }

  /// Distance and heading from the truth.
  [[nodiscard]] Eigen::Vector2d Error() const {
    const Pose2 error = X_WB_.Inverse() * last_.X_OB;
    return {error.translation().norm(), std::abs(error.yaw())};
  }
  [[nodiscard]] const WheelOdometry& odometry() const { return odometry_; }
  [[nodiscard]] const OdometryIncrement& last() const { return last_; }

  static constexpr double kBias = 0.03;

 private:
  void Send(const std::string& name, const std::vector<double>& values) {
    const DbcMessage& message = *dbc_.FindMessage(name).value();
    CanFrame frame;
    frame.id = message.id;
    frame.size = static_cast<std::uint8_t>(message.size);
    frame.receive_time = FromNanoseconds(time_ns_);
    for (std::size_t i = 0; i < values.size(); ++i)
      EXPECT_TRUE(EncodeSignal(message.signals[i], values[i], frame.payload()));
    if (const auto increment = odometry_.Handle(frame)) last_ = *increment;
  }

  OdometryConfig config_;
  DbcFile dbc_;
  WheelOdometry odometry_;
  OdometryIncrement last_{};
  std::int64_t time_ns_ = 0;
  Pose2 X_WB_;
};

class CarModelTest : public testing::TestWithParam<const char*> {};

TEST_P(CarModelTest, FollowsAKnownDrive) {
  CarTest car(CarConfig(GetParam()));
  car.Drive(0.0, 0.0, 1.0);
  car.Drive(5.0, 0.0, 2.0);
  car.Drive(5.0, 0.5, 3.0);
  car.Drive(8.0, -0.4, 3.0);
  EXPECT_LT(car.Error()[0], 0.15);  // half a period of each change of speed is not seen
  EXPECT_LT(car.Error()[1], 0.01);
  EXPECT_TRUE(IsCovariance(car.last().covariance));
  EXPECT_NEAR(car.last().yaw_rate_radps, -0.4, 0.01);
  EXPECT_EQ(car.odometry().counters().slips, 0);
}

INSTANTIATE_TEST_SUITE_P(Models,
                         CarModelTest,
                         testing::Values("differential", "ackermann", "four_wheel"));

OdometryConfig WithYawRate(OdometryConfig config) {
  config.yaw_rate = {.signal = "INERTIAL.YAW_RATE", .unit_radps = 1.0, .bias_sigma_radps = 0.05};
  return config;
}

TEST(CarYawRateTest, LearnsTheBiasWhileItStandsAndFollows) {
  CarTest car(WithYawRate(CarConfig("differential")));
  car.Drive(0.0, 0.0, 3.0);
  EXPECT_NEAR(car.odometry().yaw_rate_bias_radps().value(), CarTest::kBias, 2e-4);
  EXPECT_EQ(car.last().flags, kOdometryStandstill);
  car.Drive(5.0, 0.3, 5.0);
  EXPECT_LT(car.Error()[1], 0.01);
}

TEST(CarYawRateTest, CountsTheFramesOfAllItsSensors) {
  CarTest car(WithYawRate(CarConfig("ackermann")));
  car.Drive(5.0, 0.0, 0.1);
  for (const char* name : {"STEERING", "INERTIAL", "INERTIAL", "SPEEDS"})
    car.SendCut(name);
  EXPECT_EQ(car.odometry().frame_counters().frames, 34);
  EXPECT_EQ(car.odometry().frame_counters().short_frames, 4);
  EXPECT_EQ(car.odometry().signals().counters().short_frames, 1);
}

/// As a car that creeps slower than its wheels' sensors see.
TEST(CarYawRateTest, DoesNotTakeATurnForItsBias) {
  CarTest car(WithYawRate(CarConfig("differential")));
  car.Drive(0.0, 0.0, 3.0);
  car.TurnUnseen(0.1, 5.0);
  EXPECT_NEAR(car.odometry().yaw_rate_bias_radps().value(), CarTest::kBias, 2e-3);
  EXPECT_EQ(car.last().flags, kOdometrySlip);
  car.Drive(0.0, 0.0, 3.0);
  EXPECT_NEAR(car.odometry().yaw_rate_bias_radps().value(), CarTest::kBias, 5e-4);
  EXPECT_EQ(car.last().flags, kOdometryStandstill);
}

TEST(CarYawRateTest, LearnsABiasThatHasChanged) {
  CarTest car(WithYawRate(CarConfig("differential")));
  car.Drive(0.0, 0.0, 3.0);
  car.TurnUnseen(0.1, 35.0);
  EXPECT_NEAR(car.odometry().yaw_rate_bias_radps().value(), CarTest::kBias + 0.1, 1e-3);
  EXPECT_EQ(car.last().flags, kOdometryStandstill);
}

TEST(CarYawRateTest, KeepsItsBiasWhenTheClockJumpsBack) {
  CarTest car(WithYawRate(CarConfig("differential")));
  car.Drive(0.0, 0.0, 10.0);
  car.JumpBack(8.0);
  car.Drive(0.0, 0.0, 1.0);  // until it is believed
  EXPECT_EQ(car.odometry().counters().clock_jumps, 1);
  EXPECT_NEAR(car.odometry().yaw_rate_bias_radps().value(), CarTest::kBias, 2e-4);
  car.Drive(5.0, 0.3, 5.0);
  EXPECT_LT(car.Error()[1], 0.01);
}

TEST(CarYawRateTest, FlagsAWheelThatSpinsAndKeepsTheHeading) {
  OdometryConfig config = CarConfig("differential");
  config.wheels.front_left_signal = config.wheels.front_right_signal = "";
  const auto heading_error = [](const OdometryConfig& of) {
    CarTest car(of);
    car.Drive(0.0, 0.0, 3.0);
    car.Drive(2.0, 0.0, 2.0);
    EXPECT_EQ(car.odometry().counters().slips, 0);
    car.Drive(2.0, 0.0, 1.0, 0.19);
    return Eigen::Vector2d(car.Error()[1], static_cast<double>(car.odometry().counters().slips));
  };
  const Eigen::Vector2d alone = heading_error(config);
  const Eigen::Vector2d fused = heading_error(WithYawRate(config));
  EXPECT_NEAR(alone[0], 0.119, 0.005);
  EXPECT_EQ(alone[1], 0.0);
  EXPECT_LT(fused[0], 0.04);
  EXPECT_GT(fused[1], 30.0);
}

TEST(CarSteeringTest, FlagsARearWheelThatSpins) {
  OdometryConfig config = CarConfig("ackermann");
  config.wheels.front_left_signal = config.wheels.front_right_signal = "";
  CarTest car(config);
  car.Drive(2.0, 0.2, 2.0);
  EXPECT_EQ(car.odometry().counters().slips, 0);
  car.Drive(2.0, 0.2, 1.0, 0.5);
  EXPECT_GT(car.odometry().counters().slips, 50);
}

TEST(CarFourWheelTest, KeepsTheHeadingWhenOneWheelSpins) {
  CarTest car(CarConfig("four_wheel"));
  car.Drive(2.0, 0.0, 2.0);
  car.Drive(2.0, 0.0, 1.0, 0.5);
  EXPECT_LT(car.Error()[1], 0.05);  // 0.31 rad by the rear wheels
  EXPECT_LT(car.Error()[0], 0.15);  // 0.25 m by the rear wheels' mean
  EXPECT_GT(car.odometry().counters().slips, 50);
}

/// Whatever the frames hold, and in whatever order they come, increments stay finite.
TEST_P(CarModelTest, SurvivesHostileFrames) {
  OdometryConfig config = WithYawRate(CarConfig(GetParam()));
  config.max_acceleration_mps2 = 15.0;
  const DbcFile dbc = DbcFile::Parse(kCarDbc, "v.dbc").value();
  WheelOdometry odometry = WheelOdometry::Create(config, dbc).value();
  std::mt19937 engine(11);
  std::int64_t time_ns = 0;
  int increments = 0;
  for (int i = 0; i < 20000; ++i) {
    const DbcMessage& message = dbc.messages()[engine() % 3];
    time_ns += static_cast<std::int64_t>(engine() % 20'000'000) - (i % 17 == 0 ? 15'000'000 : 0);
    if (engine() % 500 == 0) time_ns += 3'000'000'000;
    CanFrame frame;
    frame.id = message.id;
    frame.size = static_cast<std::uint8_t>(engine() % 20 == 0 ? engine() % 9 : message.size);
    frame.receive_time = FromNanoseconds(time_ns);
    for (std::uint8_t& byte : frame.data)  // mostly speeds that are accepted
      byte = static_cast<std::uint8_t>(
          &byte - frame.data.data() > 1 && engine() % 8 != 0 ? engine() % 16 : engine());
    for (const auto& increment :
         {odometry.Handle(frame), odometry.Tick(FromNanoseconds(time_ns))}) {
      if (!increment || increment->time == increment->previous_time) continue;
      ++increments;
      ASSERT_GT(increment->time, increment->previous_time);
      ASSERT_TRUE(IsCovariance(increment->covariance)) << increment->covariance;
      ASSERT_TRUE(increment->X_OB.Log().allFinite());
      ASSERT_TRUE(std::isfinite(increment->yaw_rate_radps));
    }
  }
  EXPECT_GT(increments, 500);
}

TEST(CarConfigTest, NamesWhatAModelNeeds) {
  const auto error_of = [](OdometryConfig config) {
    const auto valid = config.Validate();
    return valid ? std::string() : valid.error().message;
  };
  EXPECT_EQ(error_of({.model = "bicycle"}),
            "model is 'bicycle', must be one of differential, ackermann, four_wheel");
  EXPECT_EQ(error_of({.model = "ackermann"}),
            "steering.signal is '', must be MESSAGE.SIGNAL with model ackermann");
  EXPECT_EQ(error_of({.model = "four_wheel"}),
            "wheels.front_left_signal is '', must be MESSAGE.SIGNAL with model four_wheel");
  EXPECT_EQ(error_of({.yaw_rate = {.scale = 0.0}}),
            "yaw_rate.scale is 0, must be positive and finite");
}

TEST(OdometryConfigTest, AcceptsItsDefaultsAndNamesWhatIsWrong) {
  const auto error_of = [](const auto& change) {
    OdometryConfig config;
    change(config);
    const auto valid = config.Validate();
    return valid ? "" : valid.error().message;
  };
  EXPECT_EQ(error_of([](OdometryConfig&) {}), "");
  EXPECT_EQ(error_of([](OdometryConfig& config) { config.drive.track_m = 0.0; }),
            "drive.track_m is 0, must be positive and finite");
  EXPECT_EQ(error_of([](OdometryConfig& config) { config.wheels.kind = "x"; }),
            "wheels.kind is 'x', must be one of ticks, speed");
  EXPECT_EQ(error_of([](OdometryConfig& config) { config.stale_after_s = 0.01; }),
            "stale_after_s is 0.01, must be at least max_interval_s, 0.05");
  EXPECT_EQ(error_of([](OdometryConfig& config) { config.max_speed_mps = std::nan(""); }),
            "max_speed_mps is nan, must be positive and finite");
}

TEST(WheelOdometryCreateTest, RefusesCountersThatAreTooNarrow) {
  OdometryConfig config = TicksConfig();
  config.max_speed_mps = 2000.0;
  const auto odometry =
      WheelOdometry::Create(config, DbcFile::Parse(kWheelTicksDbc, "v.dbc").value());
  ASSERT_FALSE(odometry);
  EXPECT_THAT(odometry.error().message, HasSubstr("max_speed_mps is 2000, must be less"));
}

}  // namespace
}  // namespace relocd
