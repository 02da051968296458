#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "calibration/drive_judgement.h"
#include "calibration/odometry_calibration.h"
#include "config/config.h"
#include "geometry/planar.h"
#include "support/shared_data.h"

namespace relocd {
namespace {

class RecordedCalibrationTest : public testing::TestWithParam<const char*> {};

/// A minute of a real car: calibrated on its first half, judged on its second.
TEST_P(RecordedCalibrationTest, KeepsTheSecondHalfOfARealDrive) {
  const std::string data = SharedData("comma_can");
  if (data.empty()) GTEST_SKIP() << SharedDataReason("comma_can");
  const std::string vehicle = std::string(RELOCD_SOURCE_DIR) + "/config/vehicles/toyota_rav4.yaml";
  const Config config = LoadConfig(vehicle, {std::string("odometry.model=") + GetParam()}).value();
  const DbcFile dbc = DbcFile::Read(config.can.dbc_file).value();
  const auto record = [&](const OdometryConfig& odometry) {
    return RecordOdometry(data + "/can0_vehicle_bus.log",
                          "can0",
                          OdometryRecorder::Create(odometry, dbc, config.can.messages).value())
        .value();
  };
  const OdometryRecording before = record(config.odometry);
  std::vector<ReferencePose> first;
  std::vector<ReferencePose> second;
  const double middle_s = 0.5 * before.samples.back().time_s;
  for (const TimedPose3& pose : ReadTumTrajectory(data + "/poses_tum.txt").value()) {
    const double time_s = 1e-9 * static_cast<double>(pose.time_ns - before.origin_ns);
    const ReferencePose reference{.time_s = time_s, .X_WR = ProjectToPlane(pose.X_WB)};
    if (time_s < 0.0) continue;
    (time_s < middle_s ? first : second).push_back(reference);
  }
  const auto calibration = CalibrateOdometry(before, first, config.odometry, {});
  ASSERT_TRUE(calibration) << calibration.error().message;
  const OdometryRecording after = record(ApplyCalibration(config.odometry, *calibration));
  const auto judgement = JudgeOdometry(after.X_OBs,
                                       after.origin_ns,
                                       SmoothReference(before, second, *calibration, 0.5),
                                       calibration->drive.time_offset_s)
                             .value();
  const double heading_deg = judgement.heading_error_rad * 180.0 / std::numbers::pi;
  fmt::print("second half, {:.0f} m: distance {:+.2f} %, heading {:+.2f} deg, position {:.1f} m\n",
             judgement.length_m,
             100.0 * judgement.distance_error,
             heading_deg,
             judgement.position_error_m);
  EXPECT_LT(std::abs(judgement.distance_error), 0.003);
  EXPECT_LT(std::abs(heading_deg), 1.5);
  EXPECT_LT(judgement.position_error_m, 6.0);
}

INSTANTIATE_TEST_SUITE_P(Models,
                         RecordedCalibrationTest,
                         testing::Values("differential", "four_wheel"));

}  // namespace
}  // namespace relocd
