#include "log_csv.h"

#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "messaging/channels.h"

namespace relocd {
namespace {

template <typename Message>
std::string RowOf(const LogCsv& csv, const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  std::string row;
  EXPECT_TRUE(csv.AppendRow(bytes, row));
  return row;
}

/// A camera at (10, 20, 1.5) that looks along W's x.
camera_pose_t CameraPose() {
  camera_pose_t message{};
  message.mono_ns = 1'700;
  message.camera = "front";
  message.pos[0] = 10.0;
  message.pos[1] = 20.0;
  message.pos[2] = 1.5;
  message.quat[0] = 0.5;
  message.quat[1] = -0.5;
  message.quat[2] = 0.5;
  message.quat[3] = -0.5;
  for (int i = 0; i < 6; ++i)
    message.covariance[7 * i] = 0.01;
  message.inliers = 321;
  message.confidence = 0.25;
  return message;
}

Pose3 ForwardCameraAt(const Eigen::Vector3d& p_BC) {
  constexpr double kQuarterTurn = 1.5707963267948966;
  return {RotationFromRollPitchYaw(-kQuarterTurn, 0.0, -kQuarterTurn), p_BC};
}

/// The first cells of a row, as numbers.
std::vector<double> NumbersOf(const std::string& row, std::size_t count) {
  std::vector<double> numbers;
  std::size_t at = 0;
  for (std::size_t i = 0; i < count; ++i) {
    numbers.push_back(std::stod(row.substr(at)));
    at = row.find(',', at) + 1;
  }
  return numbers;
}

TEST(LogCsvTest, ACameraPoseIsWhereTheCameraStandsAndLooks) {
  const auto csv = LogCsv::ForChannel("CAMERA_POSE", {.time_origin_ns = 1'000, .X_BC = {}});
  ASSERT_TRUE(csv);
  EXPECT_THAT(csv->header(), testing::EndsWith(",status,inliers,confidence\n"));
  const std::string row = RowOf(*csv, CameraPose());
  const auto numbers = NumbersOf(row, 4);
  EXPECT_EQ(numbers[0], 700.0);
  EXPECT_NEAR(numbers[1], 10.0, 1e-9);
  EXPECT_NEAR(numbers[2], 20.0, 1e-9);
  EXPECT_NEAR(numbers[3], 0.0, 1e-9);
  EXPECT_THAT(row, testing::EndsWith(",ok,321,0.2500\n"));
}

TEST(LogCsvTest, WithTheCamerasPlaceItIsTheBodys) {
  const auto csv = LogCsv::ForChannel(
      "CAMERA_POSE", {.time_origin_ns = 0, .X_BC = {{"front", ForwardCameraAt({1.0, 0.5, 1.5})}}});
  ASSERT_TRUE(csv);
  const auto numbers = NumbersOf(RowOf(*csv, CameraPose()), 5);
  EXPECT_NEAR(numbers[1], 9.0, 1e-9);
  EXPECT_NEAR(numbers[2], 19.5, 1e-9);
  // The lever makes the body's position the less sure, the further away it is: 0.01 (1 + 0.5^2 +
  // 1.5^2).
  EXPECT_NEAR(numbers[4], 0.01 * (1.0 + 0.25 + 2.25), 1e-9);
}

TEST(LogCsvTest, AnUnknownCameraGivesNoPose) {
  const auto csv =
      LogCsv::ForChannel("CAMERA_POSE", {.time_origin_ns = 0, .X_BC = {{"rear", Pose3()}}});
  ASSERT_TRUE(csv);
  EXPECT_EQ(RowOf(*csv, CameraPose()), "1700,,,,,,,,,,unknown_camera,321,0.2500\n");
}

TEST(LogCsvTest, AMessageWithoutAPoseSaysWhy) {
  const auto camera = LogCsv::ForChannel("CAMERA_POSE", {});
  const auto localization = LogCsv::ForChannel("LOCALIZATION", {});
  ASSERT_TRUE(camera);
  ASSERT_TRUE(localization);
  camera_pose_t without = CameraPose();
  without.status = camera_pose_t::STATUS_LOW_CONFIDENCE;
  EXPECT_EQ(RowOf(*camera, without), "1700,,,,,,,,,,low_confidence,321,0.2500\n");
  localization_t waiting{};
  waiting.mono_ns = 5;
  EXPECT_EQ(RowOf(*localization, waiting), "5,,,,,,,,,,uninitialised\n");
  waiting.status = localization_t::DEAD_RECKONING;
  EXPECT_EQ(RowOf(*localization, waiting), "5,0,0,0,0,0,0,0,0,0,dead_reckoning\n");
}

TEST(LogCsvTest, AnotherChannelIsRefused) {
  const auto csv = LogCsv::ForChannel("POSE", {});
  ASSERT_FALSE(csv);
  EXPECT_EQ(csv.error().message,
            "--channel is 'POSE', must be LOCALIZATION, ODOMETRY or CAMERA_POSE");
}

}  // namespace
}  // namespace relocd
