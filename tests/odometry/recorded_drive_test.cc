#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can/candump_log.h"
#include "core/csv.h"
#include "odometry/wheel_odometry.h"

namespace relocd {
namespace {

const std::string kSource = RELOCD_SOURCE_DIR;

/// A minute of a real car's CAN bus, which is not part of the repository.
std::string RecordedDrive() {
  return (std::filesystem::path(kSource) / "../shared/data/comma_can").string();
}

/// As config/vehicles/toyota_rav4.yaml has it.
OdometryConfig Rav4Config() {
  OdometryConfig config;
  config.wheels.kind = "speed";
  config.wheels.left_signal = "WHEEL_SPEEDS.RL";
  config.wheels.right_signal = "WHEEL_SPEEDS.RR";
  config.wheels.front_left_signal = "WHEEL_SPEEDS.FL";
  config.wheels.front_right_signal = "WHEEL_SPEEDS.FR";
  config.wheels.speed_unit_mps = 1.0 / 3.6;
  config.drive.track_m = 1.57;
  config.max_interval_s = 0.06;
  config.max_speed_mps = 60.0;
  config.max_yaw_rate_radps = 1.5;
  config.max_acceleration_mps2 = 15.0;
  return config;
}

class RecordedDriveTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(RecordedDrive())) {
      GTEST_SKIP() << "no recorded drive in " << RecordedDrive();
    }
    const auto dbc = DbcFile::Read(kSource + "/config/vehicles/toyota_rav4.dbc");
    ASSERT_TRUE(dbc) << dbc.error().message;
    auto odometry = WheelOdometry::Create(Rav4Config(), *dbc);
    ASSERT_TRUE(odometry) << odometry.error().message;
    auto log = CandumpLog::Open(RecordedDrive() + "/can0_vehicle_bus.log");
    ASSERT_TRUE(log) << log.error().message;
    while (true) {
      auto record = log->Next();
      ASSERT_TRUE(record) << record.error().message;
      if (!record->has_value()) break;
      const auto increment = odometry->Handle((*record)->frame);
      if (odometry->last_sample()) samples_.push_back(*odometry->last_sample());
      if (increment) increments_.push_back(*increment);
    }
  }

  std::vector<WheelSample> samples_;
  std::vector<OdometryIncrement> increments_;
};

TEST_F(RecordedDriveTest, DecodesEveryWheelSpeedAsTheReferenceDid) {
  const auto reference = CsvTable::Read(RecordedDrive() + "/wheel_speeds.csv");
  ASSERT_TRUE(reference);
  const auto columns = reference->Columns({"t_s", "fl_mps", "fr_mps", "rl_mps", "rr_mps"});
  ASSERT_TRUE(columns);
  ASSERT_EQ(reference->row_count(), 4974U);
  ASSERT_EQ(samples_.size(), 4974U);
  // The reference has six decimals.
  const auto six_decimals = [](double value) { return std::round(value * 1e6) / 1e6; };
  for (std::size_t row = 0; row < samples_.size(); ++row) {
    const WheelSample& sample = samples_[row];
    const std::vector<double> decoded = {ToSeconds(sample.time.time_since_epoch()),
                                         sample.front_speeds_mps[0],
                                         sample.front_speeds_mps[1],
                                         sample.speeds_mps[0],
                                         sample.speeds_mps[1]};
    for (std::size_t i = 0; i < decoded.size(); ++i) {
      const auto expected = reference->Double(row, (*columns)[i]);
      ASSERT_TRUE(expected);
      ASSERT_NEAR(six_decimals(decoded[i]), *expected, 1e-9) << reference->Where(row);
    }
  }
  fmt::print("{} of {} rows of wheel speeds equal the reference's\n",
             samples_.size(),
             reference->row_count());
}

TEST_F(RecordedDriveTest, TravelsTheDistanceWithinOneAndAHalfPercent) {
  double distance_m = 0.0;
  for (const OdometryIncrement& increment : increments_)
    distance_m += increment.X_BiBj.translation().norm();
  constexpr double kTruth = 1010.8;
  fmt::print("travelled {:.1f} m of {:.1f} m: {:+.2f} %\n",
             distance_m,
             kTruth,
             100.0 * (distance_m / kTruth - 1.0));
  EXPECT_NEAR(distance_m, kTruth, 0.015 * kTruth);
}

/// At 46447.42 s the rear wheels are 1 m/s faster for 20 ms, and the front ones are not: the only
/// thing in this minute that there is to flag.
TEST_F(RecordedDriveTest, FlagsTheBumpAndNothingElse) {
  std::vector<double> slips_s;
  for (const OdometryIncrement& increment : increments_) {
    if (increment.flags == 0) continue;
    EXPECT_EQ(increment.flags, kOdometrySlip);
    slips_s.push_back(ToSeconds(increment.time.time_since_epoch()));
  }
  EXPECT_THAT(slips_s,
              testing::ElementsAre(testing::DoubleNear(46447.422, 0.001),
                                   testing::DoubleNear(46447.438, 0.001)));
  EXPECT_EQ(increments_.size(), samples_.size());
}

}  // namespace
}  // namespace relocd
