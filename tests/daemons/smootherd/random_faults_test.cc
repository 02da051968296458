#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geometry/covariance.h"
#include "geometry/planar.h"
#include "messaging/in_process_bus.h"
#include "smootherd/smoother_node.h"
#include "smoothing/offline_smoother.h"
#include "support/camera_pose_message.h"
#include "support/random.h"
#include "support/slow_build.h"

// Drives of minutes on which everything goes wrong at random, and what must hold whatever happens.

namespace relocd {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kHourNs = 3600 * kSecondNs;
constexpr double kPeriodS = 0.05;

template <typename Numbers>
auto& Draw(Numbers& numbers, TestRandom& random) {
  return numbers.at(
      static_cast<std::size_t>(random.Integer(0, static_cast<int>(numbers.size()) - 1)));
}

double HostileNumber(TestRandom& random) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  constexpr std::array kNumbers{std::numeric_limits<double>::quiet_NaN(),
                                kInfinity,
                                -kInfinity,
                                1e308,
                                -1e308,
                                1e160,
                                1e20,
                                9e7,
                                -9e7,
                                1e4,
                                1e-320,
                                1e-11,
                                0.0,
                                -1.0};
  return Draw(kNumbers, random);
}

std::int64_t HostileTime(TestRandom& random, std::int64_t now_ns) {
  const std::array times{std::numeric_limits<std::int64_t>::max(),
                         std::numeric_limits<std::int64_t>::min(),
                         std::int64_t{0},
                         now_ns + kHourNs,
                         now_ns - kHourNs,
                         now_ns + kSecondNs / 2,
                         now_ns - 2 * kSecondNs};
  return Draw(times, random);
}

/// The node's options in one of many ways.
LocalizationConfig DrawConfig(TestRandom& random) {
  const auto sometimes = [&random] { return random.Integer(0, 3) == 0; };
  LocalizationConfig config;
  SmootherConfig& smoother = config.smoother;
  constexpr std::array kWindows{2, 10, 40, 40, 450};
  smoother.window_keyframes = Draw(kWindows, random);
  if (sometimes()) smoother.camera_yaw_sigma_rad = 0.05;
  if (sometimes()) smoother.camera_time_sigma_s = 0.1;
  if (sometimes()) smoother.odometry_yaw_rate_sigma_rad_per_s = 0.01;
  if (sometimes()) smoother.odometry_drift_sigma_rad_per_m = 0.0;
  if (sometimes()) smoother.odometry_scale_sigma = 0.0;
  if (sometimes()) smoother.fix_bias_sigmas = 0.0;
  if (sometimes()) smoother.fix_correlation_time_s = 0.0;
  if (sometimes()) smoother.relocalization_spacing_s = 0.0;
  return config;
}

/// A robot that drives in curves and stands, whose messages are late, wrong or missing, and the
/// node under test.
class FaultyDrive {
 public:
  explicit FaultyDrive(unsigned seed) : random_(seed), config_(DrawConfig(random_)) {
    bus_.Subscribe<pose_t>(
        channels::kPose, Delivery::kEvery, [this](const pose_t& m) { Check(m); });
    bus_.Subscribe<localization_t>(
        channels::kLocalization, Delivery::kEvery, [this](const localization_t& m) { Check(m); });
    bus_.Subscribe<rigid_transform_t>(
        channels::kMapToOdom, Delivery::kEvery, [this](const rigid_transform_t& m) {
          Take(std::vector<double>(m.trans, m.trans + 3));
          Take(std::vector<double>(m.quat, m.quat + 4));
        });
  }

  /// With faults, or without.
  void DriveFor(double seconds, bool is_faulty) {
    is_faulty_ = is_faulty;
    if (!is_faulty) {
      late_.clear();
      speed_mps_ = 1.5;
    }
    for (int i = 0; i < static_cast<int>(seconds / kPeriodS); ++i) {
      Step(i);
      bus_.HandlePending();
      CheckCounts();
    }
  }

  [[nodiscard]] const localization_t& last() const { return last_; }
  [[nodiscard]] double PositionError() const {
    return std::hypot(last_.x_WB_m - X_WB_.x(), last_.y_WB_m - X_WB_.y());
  }
  /// All that went out, as bits.
  [[nodiscard]] std::uint64_t digest() const { return digest_; }

 private:
  [[nodiscard]] bool Happens(double every_s) {
    return is_faulty_ && random_.Uniform(0.0, every_s) < kPeriodS;
  }

  void Step(int i) {
    if (Happens(20.0)) speed_mps_ = std::max(0.0, random_.Uniform(-1.0, 6.0));
    if (Happens(20.0)) slip_ = random_.Integer(0, 2) == 0 ? random_.Uniform(0.0, 2.0) : 1.0;
    if (Happens(60.0)) X_WB_ = X_WB_ * random_.Pose();  // carried
    if (Happens(60.0)) blind_until_ns_ = time_ns_ + kSecondNs * random_.Integer(0, 40);
    if (Happens(120.0)) time_ns_ += kSecondNs / 4 * random_.Integer(0, 20);  // nobody looked
    if (Happens(200.0)) time_ns_ += 2 * kHourNs * (random_.Integer(0, 1) == 0 ? 1 : -1);
    if (Happens(100.0)) ++odometry_run_id_;
    if (!is_faulty_) slip_ = 1.0;
    Command();
    const odometry_t odometry = NextOdometry();
    if (!Happens(3.0)) node_.Handle(odometry);
    if (Happens(5.0)) node_.Handle(odometry);  // once more
    if (time_ns_ < blind_until_ns_ && is_faulty_) return;
    if (i % 4 == 0) Send(NextFix("front"));
    if (i % 6 == 0) Send(NextFix("rear"));
    SendLate();
  }

  void Command() {
    if (Happens(100.0)) node_.Reset();
    if (Happens(100.0)) {
      pose_t pose{};
      pose.pos[0] = X_WB_.x() + random_.Uniform(-30.0, 30.0);
      pose.pos[1] = Happens(1.0) ? HostileNumber(random_) : X_WB_.y();
      const double yaw = random_.Uniform(-std::numbers::pi, std::numbers::pi);
      pose.orientation[0] = std::cos(0.5 * yaw);
      pose.orientation[3] = Happens(1.0) ? HostileNumber(random_) : std::sin(0.5 * yaw);
      node_.SetPose(pose);
    }
  }

  odometry_t NextOdometry() {
    t_s_ += kPeriodS;
    const double way = speed_mps_ * kPeriodS;
    const Pose2 motion = Pose2::Exp({way, 0.0, 0.15 * std::sin(0.1 * t_s_) * way});
    X_WB_ = X_WB_ * motion;
    const Pose2 measured =
        Pose2::Exp({slip_ * (way + random_.Normal(0.02 * way)), 0.0, motion.yaw()});
    X_OB_ = X_OB_ * measured;
    odometry_t message{};
    message.prev_mono_ns = time_ns_;
    time_ns_ += static_cast<std::int64_t>(kPeriodS * 1e9);
    message.mono_ns = time_ns_;
    message.utime = time_ns_ / 1000;
    message.run_id = odometry_run_id_;
    message.dx_m = measured.x();
    message.dy_m = measured.y();
    message.dtheta_rad = measured.yaw();
    message.x_OB_m = X_OB_.x();
    message.y_OB_m = X_OB_.y();
    message.yaw_OB_rad = X_OB_.yaw();
    message.speed_mps = slip_ * speed_mps_;
    Eigen::Map<Eigen::Matrix3d>(message.motion_covariance) =
        MakeOdometryStep({}, FromSeconds(kPeriodS), measured, {}).covariance;
    if (slip_ != 1.0 && random_.Integer(0, 1) == 0) message.flags |= odometry_t::FLAG_SLIP;
    Spoil(message);
    return message;
  }

  void Spoil(odometry_t& message) {
    if (Happens(5.0)) message.flags = random_.Integer(0, 63);
    const std::array<double*, 8> numbers{&message.dx_m,
                                         &message.dtheta_rad,
                                         &message.x_OB_m,
                                         &message.yaw_OB_rad,
                                         &message.speed_mps,
                                         &message.yaw_rate_radps,
                                         &message.motion_covariance[random_.Integer(0, 8)],
                                         &message.y_OB_m};
    if (Happens(5.0)) *Draw(numbers, random_) = HostileNumber(random_);
    if (Happens(30.0)) message.mono_ns = HostileTime(random_, time_ns_);
    if (Happens(30.0)) message.prev_mono_ns = HostileTime(random_, time_ns_);
  }

  camera_pose_t NextFix(const std::string& camera) {
    Pose2 X_WM = X_WB_ * Pose2(random_.Normal(0.1), random_.Normal(0.1), random_.Normal(0.02));
    if (Happens(0.5)) X_WM = X_WM * random_.Pose();
    camera_pose_t message = CameraPoseMessage(LiftFromPlane(X_WM));
    message.camera = camera;
    message.mono_ns = time_ns_ - random_.Integer(0, 30'000'000);
    if (Happens(200.0)) message.map_id = "other map";
    if (Happens(5.0)) message.camera = "nobody's";
    if (Happens(3.0)) message.status = camera_pose_t::STATUS_LOW_CONFIDENCE;
    if (Happens(3.0)) message.pos[random_.Integer(0, 2)] = HostileNumber(random_);
    if (Happens(3.0)) message.quat[random_.Integer(0, 3)] = HostileNumber(random_);
    if (Happens(2.0)) message.covariance[random_.Integer(0, 35)] = HostileNumber(random_);
    if (Happens(2.0)) {
      Eigen::Map<Matrix6d>(message.covariance).diagonal()[random_.Integer(0, 5)] =
          HostileNumber(random_);
    }
    if (Happens(2.0)) {
      const double scale = std::pow(10.0, random_.Uniform(-12.0, 12.0));
      Eigen::Map<Matrix6d>(message.covariance) *= scale;
    }
    if (Happens(3.0)) message.mono_ns = HostileTime(random_, time_ns_);
    return message;
  }

  /// Now, or up to two seconds later and in another order.
  void Send(const camera_pose_t& fix) {
    if (!Happens(0.3)) {
      node_.Handle(fix);
      return;
    }
    late_.push_back(fix);
    if (Happens(0.3)) std::swap(late_.front(), late_.back());
  }
  void SendLate() {
    while (!late_.empty() && (late_.size() > 6 || random_.Integer(0, 10) == 0)) {
      node_.Handle(late_.front());
      late_.pop_front();
    }
  }

  template <typename Numbers>
  void Take(const Numbers& numbers) {
    for (const double number : numbers) {
      ASSERT_TRUE(std::isfinite(number));
      std::uint64_t bits = 0;
      std::memcpy(&bits, &number, sizeof(bits));
      digest_ = (digest_ ^ bits) * 1099511628211U;
    }
  }

  void Check(const pose_t& pose) {
    Take(pose.pos);
    Take(pose.orientation);
    const std::int64_t jumps = node_.counters().clock_jumps;
    if (jumps == clock_jumps_) {
      ASSERT_GT(pose.utime, last_pose_utime_);
    }
    clock_jumps_ = jumps;
    last_pose_utime_ = pose.utime;
  }

  void Check(const localization_t& message) {
    Take(message.covariance);
    Take(std::array{message.x_WB_m, message.y_WB_m, message.yaw_WB_rad, message.jump_m});
    Take(std::array{message.jump_rad, message.time_since_fix_s, message.distance_since_fix_m});
    if (message.status != localization_t::UNINITIALISED) {
      const Eigen::Matrix3d covariance = Eigen::Map<const Eigen::Matrix3d>(message.covariance);
      ASSERT_TRUE(IsCovariance(covariance)) << covariance;
    }
    ASSERT_GE(message.resets, last_.resets);
    ASSERT_GE(message.fixes_accepted, last_.fixes_accepted);
    ASSERT_GE(message.fixes_rejected, last_.fixes_rejected);
    ASSERT_GE(message.fixes_late, last_.fixes_late);
    last_ = message;
    ++localizations_;
  }

  void CheckCounts() {
    const SmootherNode::Counters& node = node_.counters();
    const SmootherCounters& fixes = node_.smoother().counters();
    ASSERT_EQ(node.odometry, localizations_ + node.odometry_refused);
    ASSERT_EQ(node.camera_poses,
              node.no_pose + node.unknown_camera + node.bad_pose + fixes.fixes_accepted +
                  fixes.fixes_redundant + fixes.fixes_gated + fixes.fixes_late + fixes.fixes_ahead +
                  fixes.fixes_invalid);
    const auto& window = node_.smoother().window();
    const auto keyframes = static_cast<std::size_t>(config_.smoother.window_keyframes);
    const auto most = static_cast<std::size_t>(config_.smoother.max_fixes_per_keyframe);
    ASSERT_LE(window.keyframes.size(), keyframes);
    ASSERT_LE(window.fixes.size(), 3 * most * keyframes);
    if (const auto state = node_.State("boot")) {
      const auto read = ParseSavedState(FormatSavedState(*state), "state");
      ASSERT_TRUE(read) << read.error().message;
    }
  }

  TestRandom random_;
  LocalizationConfig config_;
  InProcessBus bus_;
  SmootherNode node_{config_, {{"front", Pose3()}, {"rear", Pose3()}}, bus_, 77};
  bool is_faulty_ = true;

  Pose2 X_WB_{100.0, 50.0, 1.0};
  Pose2 X_OB_;
  double t_s_ = 0.0;
  double speed_mps_ = 1.5;
  double slip_ = 1.0;
  std::int64_t time_ns_ = 10 * kHourNs;
  std::int64_t blind_until_ns_ = 0;
  std::int64_t odometry_run_id_ = 3;
  std::deque<camera_pose_t> late_;

  localization_t last_{};
  std::int64_t localizations_ = 0;
  std::int64_t last_pose_utime_ = 0;
  std::int64_t clock_jumps_ = 0;
  std::uint64_t digest_ = 14695981039346656037U;
};

/// --gtest_random_seed=N gives other drives.
unsigned FirstSeed() {
  constexpr unsigned kSeeds = 10;
  return kSeeds * static_cast<unsigned>(testing::GTEST_FLAG(random_seed));
}

TEST(RandomFaultsTest, WhateverComesThePoseStaysOneAndComesBack) {
  constexpr unsigned kDrives = kIsSlowBuild ? 1 : 3;
  for (unsigned seed = FirstSeed(); seed < FirstSeed() + kDrives; ++seed) {
    SCOPED_TRACE(seed);
    FaultyDrive drive(seed);
    drive.DriveFor(200.0, true);
    drive.DriveFor(40.0, false);
    EXPECT_EQ(drive.last().status, localization_t::OK) << drive.last().message;
    EXPECT_LT(drive.PositionError(), 0.5);
  }
}

TEST(RandomFaultsTest, TheSameAgainGivesTheSameBits) {
  FaultyDrive first(FirstSeed());
  FaultyDrive second(FirstSeed());
  first.DriveFor(30.0, true);
  second.DriveFor(30.0, true);
  EXPECT_EQ(first.digest(), second.digest());
}

}  // namespace
}  // namespace relocd
