#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geometry/planar.h"
#include "messaging/in_process_bus.h"
#include "smootherd/smoother_node.h"
#include "smoothing/offline_smoother.h"
#include "support/camera_pose_message.h"

// Messages that decode, and whose content is wrong: another program's fault, or a damaged log.

namespace relocd {
namespace {

constexpr std::int64_t kPeriodNs = 10'000'000;
constexpr std::int64_t kHourNs = 3'600'000'000'000;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// A body that drives straight on at 1 m/s, and the node under test.
class HostileMessagesTest : public testing::Test {
 protected:
  HostileMessagesTest() {
    bus_.Subscribe<pose_t>(channels::kPose, Delivery::kEvery, [this](const pose_t& m) {
      ++poses_;
      ExpectFinite(m.pos);
      ExpectFinite(m.vel);
      ExpectFinite(m.orientation);
      ExpectFinite(m.rotation_rate);
    });
    bus_.Subscribe<localization_t>(
        channels::kLocalization, Delivery::kEvery, [this](const localization_t& m) {
          last_ = m;
          ExpectFinite(m.covariance);
          ExpectFinite(std::array{m.x_WB_m, m.y_WB_m, m.yaw_WB_rad, m.jump_m, m.jump_rad});
          ExpectFinite(std::array{m.speed_mps, m.yaw_rate_radps, m.distance_since_fix_m});
        });
    bus_.Subscribe<rigid_transform_t>(
        channels::kMapToOdom, Delivery::kEvery, [this](const rigid_transform_t& m) {
          ExpectFinite(m.trans);
          ExpectFinite(m.quat);
        });
  }

  template <typename Numbers>
  void ExpectFinite(const Numbers& numbers) {
    for (const double number : numbers)
      EXPECT_TRUE(std::isfinite(number)) << "after " << what_;
  }

  odometry_t NextOdometry() {
    odometry_t message{};
    message.prev_mono_ns = time_ns_;
    time_ns_ += kPeriodNs;
    x_m_ += 0.01;
    x_OB_m_ += 0.01;
    message.mono_ns = time_ns_;
    message.run_id = 3;
    message.dx_m = 0.01;
    message.x_OB_m = x_OB_m_;
    message.speed_mps = 1.0;
    Eigen::Map<Eigen::Matrix3d>(message.motion_covariance) =
        MakeOdometryStep({}, Duration(kPeriodNs), Pose2(0.01, 0.0, 0.0), {}).covariance;
    return message;
  }

  /// Of a camera in the body's origin, whose axes are the body's.
  [[nodiscard]] camera_pose_t Fix() const {
    camera_pose_t message = CameraPoseMessage(LiftFromPlane(Pose2(x_m_, 0.0, 0.0)));
    message.mono_ns = time_ns_;
    return message;
  }

  void DriveFor(double seconds) {
    for (int i = 0; i < static_cast<int>(seconds * 100.0); ++i) {
      node_.Handle(NextOdometry());
      if (i % 20 == 19) node_.Handle(Fix());
    }
    bus_.HandlePending();
  }

  /// What STATUS says of `name`.
  [[nodiscard]] double Figure(const std::string& name) const {
    for (const StatusValue& value : node_.Status({}).values) {
      if (value.name == name) return value.value;
    }
    ADD_FAILURE() << "STATUS has no " << name;
    return 0.0;
  }

  InProcessBus bus_;
  SmootherNode node_{LocalizationConfig(), {{"front", Pose3()}}, bus_, 77};
  localization_t last_{};
  int poses_ = 0;
  std::int64_t time_ns_ = 10 * kHourNs;
  double x_m_ = 0.0;
  double x_OB_m_ = 0.0;
  std::string what_ = "nothing";
};

TEST_F(HostileMessagesTest, AFixBeforeAnyOdometryIsCountedAndHasNoEffect) {
  node_.Handle(Fix());
  bus_.HandlePending();
  EXPECT_EQ(Figure("fixes_ahead"), 1.0);
  EXPECT_EQ(poses_, 0);
  EXPECT_EQ(node_.Status({}).message, "no odometry since the start");
  DriveFor(10.0);
  EXPECT_EQ(last_.status, localization_t::OK);
  EXPECT_NEAR(last_.x_WB_m, x_m_, 0.1);
}

/// Each number of a camera's pose, not finite; and covariances that are none.
TEST_F(HostileMessagesTest, CameraPosesThatAreNoneAreCountedOneByOne) {
  DriveFor(10.0);
  std::vector<camera_pose_t> wrong;
  for (const double number : {kNan, kInfinity, -kInfinity}) {
    for (int i = 0; i < 3; ++i) {
      wrong.push_back(Fix());
      wrong.back().pos[i] = number;
    }
    for (int i = 0; i < 4; ++i) {
      wrong.push_back(Fix());
      wrong.back().quat[i] = number;
    }
    for (int i = 0; i < 36; ++i) {
      wrong.push_back(Fix());
      wrong.back().covariance[i] = number;
    }
  }
  const auto with_covariance = [&](int row, int column, double value) {
    wrong.push_back(Fix());
    wrong.back().covariance[6 * row + column] = value;
  };
  for (int i = 0; i < 6; ++i) {
    with_covariance(i, i, 0.0);
    with_covariance(i, i, -1e-4);
  }
  with_covariance(0, 1, 0.005);  // not symmetric
  wrong.push_back(Fix());        // symmetric with a correlation of 1.5
  wrong.back().covariance[1] = wrong.back().covariance[6] = 0.015;
  for (const std::int64_t time_ns :
       {std::numeric_limits<std::int64_t>::max(), std::numeric_limits<std::int64_t>::min()}) {
    wrong.push_back(Fix());
    wrong.back().mono_ns = time_ns;
  }
  for (const camera_pose_t& message : wrong)
    node_.Handle(message);
  EXPECT_EQ(Figure("camera_poses_bad"), static_cast<double>(wrong.size()));
  EXPECT_EQ(Figure("fixes_invalid"), 0.0);
  DriveFor(1.0);
  EXPECT_EQ(last_.status, localization_t::OK);
  EXPECT_NEAR(last_.x_WB_m, x_m_, 0.1);
  EXPECT_EQ(last_.fixes_rejected, static_cast<std::int64_t>(wrong.size()));
}

/// Numbers whose squares overflow, beside good ones.
TEST_F(HostileMessagesTest, CovariancesThatOverflowAreRefused) {
  DriveFor(10.0);
  for (const int i : {1, 2, 3, 5, 6, 7}) {
    odometry_t message = NextOdometry();
    message.motion_covariance[i] = -1e308;
    node_.Handle(message);
    camera_pose_t fix = Fix();
    fix.covariance[i] = -1e308;
    if (i != 7) node_.Handle(fix);
  }
  EXPECT_EQ(Figure("odometry_refused"), 6.0);
  EXPECT_EQ(Figure("camera_poses_bad"), 5.0);
  DriveFor(1.0);
  EXPECT_EQ(last_.status, localization_t::OK);
}

/// The wheels' message claims kilometres in a hundredth of a second, and a jumped X_OB stays so.
TEST_F(HostileMessagesTest, MotionsThatNoVehicleMakesAreCountedAndNotFollowed) {
  DriveFor(10.0);
  odometry_t message = NextOdometry();
  message.dx_m = 9e7;
  node_.Handle(message);
  NextOdometry();  // is lost: the next one is bridged by X_OB
  x_OB_m_ += 5e4;
  node_.Handle(NextOdometry());
  EXPECT_EQ(Figure("odometry_jumps"), 2.0);
  DriveFor(1.0);
  EXPECT_EQ(Figure("odometry_refused"), 0.0);
  EXPECT_EQ(last_.status, localization_t::OK);
  EXPECT_NEAR(last_.x_WB_m, x_m_, 0.2);
}

TEST_F(HostileMessagesTest, FixesFromHoursAgoAndHoursAheadAreCountedApart) {
  DriveFor(10.0);
  for (const std::int64_t hours : {-2, 3, 4}) {
    camera_pose_t fix = Fix();
    fix.mono_ns += hours * kHourNs;
    node_.Handle(fix);
  }
  EXPECT_EQ(Figure("fixes_late"), 1.0);
  EXPECT_EQ(Figure("fixes_ahead"), 2.0);
  DriveFor(1.0);
  EXPECT_EQ(last_.status, localization_t::OK);
}

TEST_F(HostileMessagesTest, OdometryThatIsNoneIsCountedOneByOneAndBridged) {
  DriveFor(10.0);
  int sent = 0;
  const auto send = [&](const auto& change) {
    odometry_t message = NextOdometry();
    change(message);
    node_.Handle(message);
    ++sent;
  };
  for (const double number : {kNan, kInfinity, -kInfinity}) {
    send([&](odometry_t& m) { m.dx_m = number; });
    send([&](odometry_t& m) { m.dtheta_rad = number; });
    send([&](odometry_t& m) { m.x_OB_m = number; });
    send([&](odometry_t& m) { m.yaw_OB_rad = number; });
    send([&](odometry_t& m) { m.speed_mps = number; });
    send([&](odometry_t& m) { m.motion_covariance[0] = number; });
    send([&](odometry_t& m) { m.motion_covariance[5] = number; });
  }
  send([](odometry_t& m) { m.mono_ns = std::numeric_limits<std::int64_t>::max(); });
  send([](odometry_t& m) { m.mono_ns = std::numeric_limits<std::int64_t>::min(); });
  send([](odometry_t& m) { m.prev_mono_ns = std::numeric_limits<std::int64_t>::min(); });
  EXPECT_EQ(Figure("odometry_refused"), sent);
  DriveFor(1.0);
  EXPECT_EQ(last_.status, localization_t::OK);
  EXPECT_NEAR(last_.x_WB_m, x_m_, 0.1);
}

}  // namespace
}  // namespace relocd
