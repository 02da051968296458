#include "smootherd/smoother_node.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geometry/angle.h"
#include "geometry/planar.h"
#include "messaging/in_process_bus.h"
#include "smoothing/offline_smoother.h"
#include "support/camera_pose_message.h"

namespace relocd {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kPeriodNs = 20'000'000;
constexpr std::int64_t kSecondNs = 1'000'000'000;

/// A camera 1 m ahead and 1.5 m up that looks forward.
Pose3 CameraMounting() {
  return {RotationFromRollPitchYaw(-std::numbers::pi / 2.0, 0.0, -std::numbers::pi / 2.0),
          {1.0, 0.0, 1.5}};
}

/// A body that drives in curves at 1 m/s, odometryd and inferenced on it, and the node under test.
class SmootherNodeTest : public testing::Test {
 protected:
  SmootherNodeTest() {
    bus_.Subscribe<pose_t>(
        channels::kPose, Delivery::kEvery, [this](const pose_t& m) { poses_.push_back(m); });
    bus_.Subscribe<localization_t>(
        channels::kLocalization, Delivery::kEvery, [this](const localization_t& m) {
          localizations_.push_back(m);
        });
    bus_.Subscribe<rigid_transform_t>(
        channels::kMapToOdom, Delivery::kEvery, [this](const rigid_transform_t& m) {
          transforms_.push_back(m);
        });
    Restart();
  }

  /// A new process of the node, which knows nothing.
  void Restart() {
    node_.emplace(config_, std::map<std::string, Pose3>{{"front", CameraMounting()}}, bus_, 77);
  }

  /// The next odometry message; `lost` ones before it are not handed on.
  odometry_t Drive(int lost = 0) {
    odometry_t message{};
    for (int i = 0; i <= lost; ++i) {
      const Pose2 motion =
          is_first_ ? Pose2() : Pose2::Exp({0.02, 0.0, 0.004 * std::sin(0.3 * t_s_)});
      const std::int64_t before_ns = time_ns_;
      if (!is_first_) time_ns_ += kPeriodNs;
      X_WB_ = X_WB_ * motion;
      X_OB_ = X_OB_ * motion;
      t_s_ += 0.02;
      message = odometry_t{};
      message.utime = time_ns_ / 1000 + 5;
      message.mono_ns = time_ns_;
      message.prev_mono_ns = before_ns;
      message.seq = odometry_seq_++;
      message.run_id = odometry_run_id_;
      message.dx_m = motion.x();
      message.dy_m = motion.y();
      message.dtheta_rad = motion.yaw();
      Eigen::Map<Eigen::Matrix3d>(message.motion_covariance) =
          MakeOdometryStep({}, FromSeconds(0.02), motion, {}).covariance;
      message.x_OB_m = X_OB_.x();
      message.y_OB_m = X_OB_.y();
      message.yaw_OB_rad = X_OB_.yaw();
      message.speed_mps = 1.0;
      is_first_ = false;
    }
    return message;
  }

  /// odometryd was killed and is back after `gap_s`, in which the body drove on.
  void RestartOdometry(double gap_s) {
    time_ns_ += static_cast<std::int64_t>(gap_s * 1e9);
    X_WB_ = X_WB_ * Pose2(gap_s * 1.0, 0.0, 0.0);
    X_OB_ = Pose2();
    ++odometry_run_id_;
    odometry_seq_ = 0;
    is_first_ = true;
  }

  [[nodiscard]] camera_pose_t Fix() {
    const Pose3 X_WB =
        LiftFromPlane(X_WB_ * Pose2(0.1 * normal_(engine_), 0.1 * normal_(engine_), 0.0));
    camera_pose_t message = CameraPoseMessage(X_WB * CameraMounting());
    message.utime = time_ns_ / 1000 + 5;
    message.mono_ns = time_ns_;
    message.seq = fix_seq_++;
    return message;
  }

  void DriveFor(double seconds, bool with_fixes = true) {
    const int steps = static_cast<int>(seconds * 50.0);
    for (int i = 0; i < steps; ++i) {
      node_->Handle(Drive());
      if (with_fixes && i % 25 == 24) node_->Handle(Fix());
    }
    bus_.HandlePending();
  }

  [[nodiscard]] Pose2 LastPose() const {
    const localization_t& last = localizations_.back();
    return {last.x_WB_m, last.y_WB_m, last.yaw_WB_rad};
  }
  [[nodiscard]] double PositionError() const {
    return (LastPose().translation() - X_WB_.translation()).norm();
  }

  LocalizationConfig config_;
  InProcessBus bus_;
  std::optional<SmootherNode> node_;
  std::vector<pose_t> poses_;
  std::vector<localization_t> localizations_;
  std::vector<rigid_transform_t> transforms_;

  Pose2 X_WB_{100.0, 50.0, 1.0};
  Pose2 X_OB_;
  double t_s_ = 0.0;
  std::int64_t time_ns_ = 1000 * kSecondNs;
  std::int64_t odometry_seq_ = 0;
  std::int64_t odometry_run_id_ = 5;
  std::int64_t fix_seq_ = 0;
  bool is_first_ = true;
  std::mt19937 engine_{1};
  std::normal_distribution<double> normal_{0.0, 1.0};
};

TEST_F(SmootherNodeTest, AnswersEachOdometryMessageAtOnce) {
  const odometry_t message = Drive();
  node_->Handle(message);
  bus_.HandlePending();
  ASSERT_EQ(localizations_.size(), 1U);
  const localization_t& answer = localizations_.front();
  EXPECT_EQ(answer.status, localization_t::UNINITIALISED);
  EXPECT_EQ(answer.mono_ns, message.mono_ns);
  EXPECT_EQ(answer.utime, message.utime);
  EXPECT_EQ(answer.odometry_run_id, message.run_id);
  EXPECT_EQ(answer.run_id, 77);
  EXPECT_EQ(answer.time_since_fix_s, -1.0);
  EXPECT_EQ(answer.last_fix_seq, -1);
  EXPECT_EQ(answer.message, "no fix yet");
  EXPECT_TRUE(poses_.empty());
  EXPECT_EQ(node_->Status({}).level, status_t::WARNING);
}

TEST_F(SmootherNodeTest, FollowsTheBodyOnTheMap) {
  DriveFor(20.0);
  EXPECT_EQ(localizations_.size(), 1000U);
  EXPECT_GT(poses_.size(), 900U);
  EXPECT_LT(PositionError(), 0.2);
  EXPECT_NEAR(LastPose().yaw(), X_WB_.yaw(), 0.05);
  const localization_t& last = localizations_.back();
  EXPECT_EQ(last.status, localization_t::OK);
  EXPECT_EQ(last.message, "");
  EXPECT_EQ(last.map_id, "map");
  EXPECT_EQ(last.last_fix_seq, fix_seq_ - 2);  // the last came after this message
  EXPECT_NEAR(poses_.back().pos[0], last.x_WB_m, 1e-12);
  EXPECT_EQ(node_->Status({}).message, "");
}

TEST_F(SmootherNodeTest, MapToOdomTakesTheOdometrysPoseToTheMaps) {
  DriveFor(20.0);
  node_->Handle(Drive());  // takes up the last fix
  bus_.HandlePending();
  ASSERT_FALSE(transforms_.empty());
  const rigid_transform_t& last = transforms_.back();
  const Pose2 X_WO(last.trans[0], last.trans[1], 2.0 * std::atan2(last.quat[3], last.quat[0]));
  EXPECT_LT(((X_WO * X_OB_).translation() - LastPose().translation()).norm(), 5e-3);
  // Once for a fix that moved it, and seldom for the odometry's drift that is put right.
  EXPECT_LE(transforms_.size(), 60U);
  EXPECT_GT(localizations_.size(), 900U);
}

TEST_F(SmootherNodeTest, WithoutAFixNothingJumps) {
  DriveFor(20.0);
  node_->Handle(Drive());  // takes up the last fix
  bus_.HandlePending();
  const std::size_t before = localizations_.size();
  for (int i = 0; i < 100; ++i)
    node_->Handle(Drive(i % 10 == 0 ? 3 : 0));
  bus_.HandlePending();
  ASSERT_EQ(localizations_.size(), before + 100);
  for (std::size_t i = before; i < localizations_.size(); ++i) {
    EXPECT_LT(localizations_[i].jump_m, 1e-9) << i;
    EXPECT_LT(localizations_[i].jump_rad, 1e-9) << i;
  }
}

TEST_F(SmootherNodeTest, AFixPublishesNothingByItselfAndIsInTheNextPose) {
  DriveFor(20.0);
  node_->Handle(Drive());
  bus_.HandlePending();
  const std::size_t before = poses_.size() + localizations_.size() + transforms_.size();
  node_->Handle(Fix());
  bus_.HandlePending();
  EXPECT_EQ(poses_.size() + localizations_.size() + transforms_.size(), before);
  const std::int64_t fix_seq = fix_seq_ - 1;
  node_->Handle(Drive());
  bus_.HandlePending();
  EXPECT_GE(poses_.size() + localizations_.size() + transforms_.size(), before + 2);
  EXPECT_EQ(localizations_.back().last_fix_seq, fix_seq);
}

TEST_F(SmootherNodeTest, ALostMessageIsBridged) {
  DriveFor(20.0);
  node_->Handle(Drive());  // takes up the last fix
  node_->Handle(Drive(10));
  bus_.HandlePending();
  EXPECT_LT(PositionError(), 0.2);
  EXPECT_LT(localizations_.back().jump_m, 1e-9);
  EXPECT_EQ(node_->counters().odometry_bridged, 1);
}

TEST_F(SmootherNodeTest, OldAndRepeatedMessagesHaveNoEffect) {
  DriveFor(20.0);
  const odometry_t message = Drive();
  node_->Handle(message);
  bus_.HandlePending();
  const std::size_t answers = localizations_.size();
  const Pose2 before = LastPose();
  node_->Handle(message);
  odometry_t old = message;
  old.mono_ns -= 5 * kPeriodNs;
  node_->Handle(old);
  odometry_t not_finite = Drive();
  not_finite.dx_m = std::numeric_limits<double>::quiet_NaN();
  node_->Handle(not_finite);
  bus_.HandlePending();
  EXPECT_EQ(localizations_.size(), answers);
  EXPECT_EQ(LastPose().x(), before.x());
  EXPECT_EQ(node_->counters().odometry_refused, 3);
  node_->Handle(Drive());  // X_OB bridges the one that was refused
  bus_.HandlePending();
  EXPECT_LT(PositionError(), 0.2);
}

TEST_F(SmootherNodeTest, ThePoseGoesOnWhenOdometryRestarts) {
  DriveFor(20.0);
  node_->Handle(Drive());  // takes up the last fix
  bus_.HandlePending();
  const double sigma_before = std::sqrt(localizations_.back().covariance[0]);
  RestartOdometry(0.3);
  node_->Handle(Drive());
  bus_.HandlePending();
  EXPECT_LT(PositionError(), 0.4);
  EXPECT_LT(localizations_.back().jump_m, 1e-9);
  EXPECT_GT(std::sqrt(localizations_.back().covariance[0]), sigma_before + 0.05);
  EXPECT_EQ(node_->counters().odometry_restarts, 1);
  DriveFor(20.0);
  EXPECT_LT(PositionError(), 0.2);
  EXPECT_EQ(localizations_.back().status, localization_t::OK);
}

TEST_F(SmootherNodeTest, SlipWidensTheCovariance) {
  DriveFor(20.0);
  const double before = localizations_.back().covariance[0];
  for (int i = 0; i < 50; ++i) {
    odometry_t message = Drive();
    message.flags = odometry_t::FLAG_SLIP;
    node_->Handle(message);
  }
  bus_.HandlePending();
  EXPECT_GT(localizations_.back().covariance[0], before + 0.01);
}

TEST_F(SmootherNodeTest, DeadReckonsWithoutFixesAndSaysSo) {
  DriveFor(20.0);
  DriveFor(10.0, false);
  EXPECT_EQ(localizations_.back().status, localization_t::DEAD_RECKONING);
  EXPECT_THAT(localizations_.back().message, HasSubstr("no fix for 10.0 s, 10.0 m"));
  EXPECT_NEAR(localizations_.back().time_since_fix_s, 10.0, 0.1);
  EXPECT_LT(PositionError(), 0.4);
}

TEST_F(SmootherNodeTest, ALateFixIsPutInAtItsTime) {
  DriveFor(20.0);
  const camera_pose_t fix = Fix();
  DriveFor(1.0, false);
  node_->Handle(fix);
  bus_.HandlePending();
  EXPECT_LT(PositionError(), 0.2);
  EXPECT_EQ(node_->smoother().counters().fixes_gated, 0);
}

TEST_F(SmootherNodeTest, UnusableCameraPosesAreCountedByTheirReason) {
  DriveFor(20.0);
  const std::int64_t accepted = node_->smoother().counters().fixes_accepted;
  camera_pose_t message = Fix();
  message.status = camera_pose_t::STATUS_LOW_CONFIDENCE;
  node_->Handle(message);
  message = Fix();
  message.camera = "rear";
  node_->Handle(message);
  message = Fix();
  message.quat[0] += 0.5;
  node_->Handle(message);
  message = Fix();
  message.pos[1] = std::numeric_limits<double>::infinity();
  node_->Handle(message);
  message = Fix();
  message.covariance[0] = -1.0;
  node_->Handle(message);
  message = Fix();  // a camera that looks straight up, so a body that stands on its tail
  Eigen::Map<Eigen::Vector4d>(message.quat) << 1.0, 0.0, 0.0, 0.0;
  node_->Handle(message);
  EXPECT_EQ(node_->counters().no_pose, 1);
  EXPECT_EQ(node_->counters().unknown_camera, 1);
  EXPECT_EQ(node_->counters().bad_pose, 4);
  EXPECT_EQ(node_->smoother().counters().fixes_accepted, accepted);
  EXPECT_THAT(node_->Status({}).message, HasSubstr("of a camera that the config has not"));
}

TEST_F(SmootherNodeTest, AnotherMapIsAnotherWorld) {
  DriveFor(20.0);
  camera_pose_t message = Fix();
  message.map_id = "another";
  node_->Handle(message);
  node_->Handle(Drive());
  bus_.HandlePending();
  EXPECT_EQ(localizations_.back().status, localization_t::UNINITIALISED);
  EXPECT_EQ(node_->counters().map_changes, 1);
}

TEST_F(SmootherNodeTest, ContinuesExactlyWhereAKilledOneLeftOff) {
  DriveFor(20.0);
  const auto state = node_->State("boot");
  ASSERT_TRUE(state);
  // Both go on without fixes, so that they must stay equal.
  Restart();
  node_->Restore(*state, "boot");
  const Pose2 X_WO = state->X_WB * state->X_OB.Inverse();
  Drive(20);
  node_->Handle(Drive());
  bus_.HandlePending();
  EXPECT_LT(((X_WO * X_OB_).translation() - LastPose().translation()).norm(), 1e-9);
  EXPECT_EQ(localizations_.back().status, localization_t::DEAD_RECKONING);
  EXPECT_THAT(node_->restore_outcome(), HasSubstr("continues from the saved pose"));
  DriveFor(5.0);
  EXPECT_EQ(localizations_.back().status, localization_t::OK);
  EXPECT_LT(PositionError(), 0.3);
  EXPECT_EQ(node_->smoother().counters().relocalizations, 0);
}

TEST_F(SmootherNodeTest, BeginsNearTheSavedPoseWhenOdometryRestartedToo) {
  DriveFor(20.0);
  const auto state = node_->State("boot");
  ASSERT_TRUE(state);
  RestartOdometry(2.0);
  Restart();
  node_->Restore(*state, "boot");
  node_->Handle(Drive());
  bus_.HandlePending();
  EXPECT_LT((LastPose().translation() - state->X_WB.translation()).norm(), 1e-9);
  EXPECT_GT(std::sqrt(localizations_.back().covariance[0]), 2.0);
  DriveFor(5.0);
  EXPECT_LT(PositionError(), 0.3);
}

TEST_F(SmootherNodeTest, AStateThatIsTooOldOrOfAnotherBootIsNotUsed) {
  DriveFor(20.0);
  const auto state = node_->State("boot");
  ASSERT_TRUE(state);
  Restart();
  node_->Restore(*state, "another boot");
  node_->Handle(Drive());
  EXPECT_THAT(node_->restore_outcome(), HasSubstr("of an earlier boot: not used"));
  bus_.HandlePending();
  EXPECT_EQ(localizations_.back().status, localization_t::UNINITIALISED);

  Restart();
  node_->Restore(*state, "boot");
  time_ns_ += 400 * kSecondNs;
  node_->Handle(Drive());
  EXPECT_THAT(node_->restore_outcome(), HasSubstr("must be in [0, 300] s: not used"));
}

TEST_F(SmootherNodeTest, HasNoStateToSaveBeforeItKnowsAPose) {
  EXPECT_FALSE(node_->State("boot"));
  node_->Handle(Drive());
  EXPECT_FALSE(node_->State("boot"));
}

TEST_F(SmootherNodeTest, SilentOdometryIsAnError) {
  EXPECT_EQ(node_->Status({}).message, "no odometry since the start");
  DriveFor(20.0);
  const ClockReading later{.monotonic = FromNanoseconds(time_ns_ + 3 * kSecondNs)};
  EXPECT_EQ(node_->Status(later).level, status_t::ERROR);
  EXPECT_EQ(node_->Status(later).message, "no odometry for 3.0 s");
}

pose_t PoseMessage(const Pose2& X_WB) {
  pose_t message{};
  message.pos[0] = X_WB.x();
  message.pos[1] = X_WB.y();
  message.orientation[0] = std::cos(0.5 * X_WB.yaw());
  message.orientation[3] = std::sin(0.5 * X_WB.yaw());
  return message;
}

TEST_F(SmootherNodeTest, APoseThatIsSetIsTheNextOneAndAJump) {
  DriveFor(20.0);
  for (const double yaw : {3.1, -std::numbers::pi, 0.5}) {
    const Pose2 X_WB(500.0, -300.0, yaw);
    node_->SetPose(PoseMessage(X_WB));
    node_->Handle(Drive());
    bus_.HandlePending();
    const localization_t& answer = localizations_.back();
    EXPECT_NEAR(answer.x_WB_m, 500.0, 0.1) << yaw;
    EXPECT_NEAR(answer.y_WB_m, -300.0, 0.1) << yaw;
    EXPECT_NEAR(std::abs(WrapAngle(answer.yaw_WB_rad - yaw)), 0.0, 0.05);
    EXPECT_NE(answer.status, localization_t::OK);
  }
  EXPECT_GT(localizations_[localizations_.size() - 3].jump_m, 100.0);
  EXPECT_EQ(localizations_.back().resets, 3);
  EXPECT_EQ(node_->counters().poses_set, 3);
}

TEST_F(SmootherNodeTest, APoseThatIsSetWrongIsOverruledByTheFixes) {
  DriveFor(20.0);
  node_->SetPose(PoseMessage(X_WB_ * Pose2(100.0, 0.0, std::numbers::pi)));
  DriveFor(30.0);
  EXPECT_LT((Pose2(localizations_.back().x_WB_m, localizations_.back().y_WB_m, 0.0).translation() -
             X_WB_.translation())
                .norm(),
            1.0);
  EXPECT_EQ(localizations_.back().status, localization_t::OK);
}

TEST_F(SmootherNodeTest, RefusesToBeSetToWhatIsNoPose) {
  node_->SetPose(PoseMessage(Pose2()));  // before any odometry
  DriveFor(20.0);
  pose_t message = PoseMessage(Pose2());
  message.pos[1] = std::numeric_limits<double>::quiet_NaN();
  node_->SetPose(message);
  message.pos[1] = 1e300;  // finite, and its square is not
  node_->SetPose(message);
  message = PoseMessage(Pose2());
  message.orientation[0] = 0.0;  // no unit quaternion
  node_->SetPose(message);
  message = PoseMessage(Pose2());
  message.orientation[0] = 0.0;
  message.orientation[1] = 1.0;  // upside down
  node_->SetPose(message);
  EXPECT_EQ(node_->counters().poses_refused, 5);
  EXPECT_EQ(node_->counters().poses_set, 0);
  EXPECT_EQ(localizations_.back().status, localization_t::OK);
}

TEST_F(SmootherNodeTest, AResetForgetsThePoseAndTheFixesFindItAgain) {
  DriveFor(20.0);
  node_->Reset();
  node_->Handle(Drive());
  bus_.HandlePending();
  EXPECT_EQ(localizations_.back().status, localization_t::UNINITIALISED);
  EXPECT_EQ(localizations_.back().resets, 1);
  DriveFor(20.0);
  EXPECT_EQ(localizations_.back().status, localization_t::OK);
}

/// Also one to which there was no pose in between.
TEST_F(SmootherNodeTest, TheFirstPoseAfterAResetIsAJump) {
  DriveFor(20.0);
  node_->Reset();
  DriveFor(5.0, false);
  X_WB_ = X_WB_ * Pose2(60.0, 0.0, 0.0);
  const std::size_t before = localizations_.size();
  DriveFor(20.0);
  double jumped_m = 0.0;
  for (std::size_t i = before; i < localizations_.size(); ++i)
    jumped_m += localizations_[i].jump_m;
  EXPECT_EQ(localizations_.back().status, localization_t::OK);
  EXPECT_GT(jumped_m, 59.0);
}

TEST_F(SmootherNodeTest, CountsStayWhenThePoseIsForgotten) {
  DriveFor(20.0);
  node_->SetPose(PoseMessage(X_WB_ * Pose2(100.0, 0.0, 1.0)));
  DriveFor(30.0);
  const localization_t before = localizations_.back();
  EXPECT_EQ(before.resets, 2);  // set, and found again
  const std::int64_t accepted = node_->smoother().counters().fixes_accepted;
  EXPECT_GT(accepted, 60);
  node_->Reset();
  DriveFor(1.0, false);
  EXPECT_EQ(localizations_.back().resets, 3);
  EXPECT_EQ(localizations_.back().fixes_accepted, accepted);
  EXPECT_EQ(localizations_.back().fixes_rejected, before.fixes_rejected);
  EXPECT_THAT(localizations_.back().message, HasSubstr("no fix yet"));
}

TEST_F(SmootherNodeTest, OneMessageFromHoursAheadDoesNotSilenceTheOthersForGood) {
  DriveFor(20.0);
  odometry_t ahead = Drive();
  ahead.mono_ns += 5 * 3600 * kSecondNs;
  node_->Handle(ahead);
  DriveFor(1.0);
  EXPECT_EQ(node_->counters().odometry_refused, 50);
  DriveFor(20.0);
  EXPECT_EQ(node_->counters().clock_jumps, 1);
  EXPECT_EQ(node_->counters().odometry_refused, 99);
  EXPECT_EQ(localizations_.back().status, localization_t::OK);
}

TEST_F(SmootherNodeTest, AClockThatJumpsBackByHoursIsFollowed) {
  DriveFor(20.0);
  time_ns_ -= 2 * 3600 * kSecondNs;
  DriveFor(30.0);
  EXPECT_EQ(node_->counters().clock_jumps, 1);
  EXPECT_EQ(localizations_.back().status, localization_t::OK);
}

TEST_F(SmootherNodeTest, SaysWhatItKnowsOfTheCameraWhereThatIsSought) {
  const auto says_so = [](const SmootherNode& node) {
    const NodeStatus status = node.Status({});
    return std::any_of(status.values.begin(), status.values.end(), [](const auto& v) {
      return v.name == "camera_time_sigma_s" && v.value == 0.1;
    });
  };
  EXPECT_FALSE(says_so(*node_));
  LocalizationConfig config;
  config.smoother.camera_time_sigma_s = 0.1;
  EXPECT_TRUE(says_so(SmootherNode(config, {}, bus_, 1)));
}

TEST_F(SmootherNodeTest, SaysHowLongItTook) {
  for (int i = 1; i <= 100; ++i)
    node_->NotePoseLatency(std::chrono::microseconds(10 * i));
  const NodeStatus status = node_->Status({});
  const auto value = std::find_if(status.values.begin(), status.values.end(), [](const auto& v) {
    return v.name == "odometry_to_pose_p99_ms";
  });
  ASSERT_NE(value, status.values.end());
  EXPECT_NEAR(value->value, 0.99, 0.011);
}

}  // namespace
}  // namespace relocd
