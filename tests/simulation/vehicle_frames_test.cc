#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "can/signal.h"
#include "config/config.h"
#include "odometry/wheel_odometry.h"
#include "simulation/drive_plan.h"
#include "simulation/test_route.h"
#include "simulation/wheel_simulator.h"
#include "support/slow_build.h"

namespace relocd {
namespace {

const std::string kVehicles = std::string(RELOCD_SOURCE_DIR) + "/config/vehicles/";

/// A vehicle, and what its frames mean.
struct Vehicle {
  OdometryConfig odometry;
  DbcFile dbc;
};

Vehicle Shipped(const std::string& name) {
  auto config = LoadConfig(kVehicles + name + ".yaml", {});
  EXPECT_TRUE(config) << config.error().message;
  return {.odometry = config->odometry, .dbc = DbcFile::Read(config->can.dbc_file).value()};
}

/// As the shipped one, with counters so fine that their steps do not matter.
Vehicle FineTicks() {
  Vehicle vehicle = Shipped("differential_demo");
  vehicle.odometry.drive.ticks_per_revolution = 1 << 20;
  vehicle.dbc = DbcFile::Parse(
                    "BO_ 416 WHEEL_TICKS: 12 BASE\n"
                    " SG_ LEFT : 0|32@1+ (1,0) [0|0] \"ticks\" BASE\n"
                    " SG_ RIGHT : 32|32@1+ (1,0) [0|0] \"ticks\" BASE\n"
                    " SG_ COUNTER : 64|4@1+ (1,0) [0|15] \"\" BASE\n"
                    " SG_ CHECKSUM : 72|8@1+ (1,0) [0|255] \"\" BASE\n",
                    "fine.dbc")
                    .value();
  return vehicle;
}

WheelSimulationOptions Perfect() {
  return {.seed = 5, .wheel_sigma_m_per_sqrt_m = 0.0};
}

/// A drive over an oval with a stop, a reversal and swaying, and its frames.
struct Drive {
  std::vector<WheelMotion> motions;
  std::vector<CandumpRecord> frames;
};

Drive MakeDrive(const Vehicle& vehicle,
                const WheelSimulationOptions& options,
                const Ground& ground,
                int laps = 1) {
  const auto plan = DrivePlan::Create(
      OvalRoute(),
      Session(),
      {.seed = options.seed, .laps = laps, .stops_m = {50.0}, .reverses_m = {150.0}});
  EXPECT_TRUE(plan);
  const VehicleGeometry geometry{.track_m = vehicle.odometry.drive.track_m};
  Drive drive{.motions = RollWheels(*plan, ground, geometry, options.period_ns()), .frames = {}};
  auto frames = SimulateWheelFrames(drive.motions, vehicle.odometry, vehicle.dbc, options);
  EXPECT_TRUE(frames) << frames.error().message;
  drive.frames = std::move(frames).value();
  return drive;
}

Drive MakeDrive(const Vehicle& vehicle, const WheelSimulationOptions& options) {
  return MakeDrive(vehicle, options, SlopedGround(0.0));
}

/// What odometry makes of the frames.
struct Estimate {
  std::vector<OdometryIncrement> increments;
  int flagged = 0;  ///< For anything but standing.
  int standing = 0;
  double worst_m = 0.0;  ///< Distance from the truth, over the whole drive.
  double worst_rad = 0.0;
};

Estimate RunOdometry(const Drive& drive, const Vehicle& vehicle) {
  WheelOdometry odometry = WheelOdometry::Create(vehicle.odometry, vehicle.dbc).value();
  Estimate estimate;
  for (const CandumpRecord& record : drive.frames) {
    const auto increment = odometry.Handle(record.frame);
    if (!increment) continue;
    const WheelMotion& truth = drive.motions.at(estimate.increments.size());
    EXPECT_EQ(ToNanoseconds(increment->time), truth.time_ns);
    const Pose2 X_OB = drive.motions.front().X_WB.Inverse() * truth.X_WB;
    const Pose2 error = X_OB.Inverse() * increment->X_OB;
    estimate.worst_m = std::max(estimate.worst_m, error.translation().norm());
    estimate.worst_rad = std::max(estimate.worst_rad, std::abs(error.yaw()));
    estimate.flagged += (increment->flags & ~kOdometryStandstill) != 0 ? 1 : 0;
    estimate.standing += (increment->flags & kOdometryStandstill) != 0 ? 1 : 0;
    estimate.increments.push_back(*increment);
  }
  EXPECT_EQ(estimate.increments.size(), drive.motions.size());
  return estimate;
}

/// The check of the whole model: with all errors off, odometry is the truth.
TEST(VehicleFramesTest, PerfectSpeedsGiveTheLoopBackToAMillimetre) {
  const Vehicle vehicle = Shipped("ackermann_demo");
  const Estimate estimate = RunOdometry(MakeDrive(vehicle, Perfect()), vehicle);
  EXPECT_LT(estimate.worst_m, 1e-3);

  EXPECT_LT(estimate.worst_rad, 1e-4);
  EXPECT_EQ(estimate.flagged, 0);
  EXPECT_GT(estimate.standing, 200);
}

TEST(VehicleFramesTest, PerfectTicksGiveTheLoopBackToAMillimetre) {
  const Vehicle vehicle = FineTicks();
  const Estimate estimate = RunOdometry(MakeDrive(vehicle, Perfect()), vehicle);
  EXPECT_LT(estimate.worst_m, 1e-3);

  EXPECT_LT(estimate.worst_rad, 1e-4);
  EXPECT_EQ(estimate.flagged, 0);
}

/// A tick is 1.8 mm: each wheel's travel is off by less than one at all times, hence the heading by
/// less than two over the track; with ticks four times as fine by a quarter of that.
TEST(VehicleFramesTest, CoarseTicksAreWrongByTheirSteps) {
  Vehicle vehicle = Shipped("differential_demo");
  const double bound_rad = 2.0 * (2.0 * std::numbers::pi * 0.3 / 1024.0) / 1.5;
  const Estimate coarse = RunOdometry(MakeDrive(vehicle, Perfect()), vehicle);
  EXPECT_LT(coarse.worst_rad, bound_rad);
  EXPECT_GT(coarse.worst_rad, 0.3 * bound_rad);
  EXPECT_LT(coarse.worst_m, 0.1);
  vehicle.odometry.drive.ticks_per_revolution *= 4;
  vehicle.odometry.max_speed_mps = 15.0;  // or the counters go round too fast
  const Estimate fine = RunOdometry(MakeDrive(vehicle, Perfect()), vehicle);
  EXPECT_LT(fine.worst_rad, 0.25 * bound_rad);
}

TEST(VehicleFramesTest, CountersWrapAndOdometryGoesOn) {
  const Vehicle vehicle = Shipped("differential_demo");
  const Drive drive = MakeDrive(vehicle, Perfect(), SlopedGround(0.0), 2);
  const DbcSignal& left = *vehicle.dbc.FindSignal("WHEEL_TICKS.LEFT")->signal;
  const DbcSignal& counter = *vehicle.dbc.FindSignal("WHEEL_TICKS.COUNTER")->signal;
  int wraps = 0;
  std::uint64_t last_ticks = 0;
  for (std::size_t i = 0; i < drive.frames.size(); ++i) {
    const CanFrame& frame = drive.frames[i].frame;
    ASSERT_EQ(DecodeBits(counter, frame.payload()), (i + 1) % 16);
    const std::uint64_t ticks = *DecodeBits(left, frame.payload());
    wraps += ticks + 0x8000 < last_ticks ? 1 : 0;
    last_ticks = ticks;
  }
  EXPECT_GE(wraps, 3);  // 65536 ticks are 120 m
  EXPECT_EQ(RunOdometry(drive, vehicle).flagged, 0);
}

TEST(VehicleFramesTest, ReversingCountsBackwards) {
  const Vehicle vehicle = Shipped("ackermann_demo");
  const Estimate estimate = RunOdometry(MakeDrive(vehicle, Perfect()), vehicle);
  double least_mps = 0.0;
  for (const OdometryIncrement& increment : estimate.increments)
    least_mps = std::min(least_mps, increment.speed_mps);
  EXPECT_NEAR(least_mps, -1.5, 0.02);
}

/// 3 % of slope are 0.045 % of way.
TEST(VehicleFramesTest, OnASlopeWheelsMeasureTheLongerWay) {
  const Vehicle vehicle = Shipped("ackermann_demo");
  const Drive drive = MakeDrive(vehicle, Perfect(), SlopedGround(0.03));
  const Estimate estimate = RunOdometry(drive, vehicle);
  const double straights_m = 160.0;
  EXPECT_GT(estimate.worst_m, 0.3 * 0.00045 * straights_m);
  EXPECT_LT(estimate.worst_m, 3.0 * 0.00045 * straights_m);
}

/// The same on the route of the campus. With its slopes, which odometry knows nothing of, the
/// wheels measure 2 cm more over 660 m, and odometry ends as far off.
TEST(VehicleFramesTest, GivesTheCampusBack) {
  if (kIsSlowBuild) GTEST_SKIP() << "making the campus takes long here; the oval stands for it";
  const auto world = MakeWorld("campus", 7);
  ASSERT_TRUE(world) << world.error().message;
  const Vehicle vehicle = Shipped("ackermann_demo");
  const auto plan = DrivePlan::Create(world->route, Session(), {.seed = 1});
  ASSERT_TRUE(plan) << plan.error().message;
  const SlopedGround flat(0.0);
  for (const Ground* const ground : {static_cast<const Ground*>(&flat), world->ground.get()}) {
    Drive drive;
    drive.motions = RollWheels(*plan, *ground, {}, Perfect().period_ns());
    drive.frames =
        SimulateWheelFrames(drive.motions, vehicle.odometry, vehicle.dbc, Perfect()).value();
    const Estimate estimate = RunOdometry(drive, vehicle);
    const double travel_m =
        0.5 * (drive.motions.back().travel_m[0] + drive.motions.back().travel_m[1]);
    if (ground == &flat) {
      EXPECT_LT(estimate.worst_m, 1e-3);
      EXPECT_NEAR(travel_m, plan->length_m(), 1e-6);
    } else {
      EXPECT_LT(estimate.worst_m, 0.1);
      EXPECT_GT(travel_m, plan->length_m() + 0.005);
      EXPECT_LT(travel_m, plan->length_m() + 0.2);
    }
  }
}

/// The error over a drive, as a mean over seeds.
double MeanHeadingError(const Vehicle& vehicle, WheelSimulationOptions options) {
  constexpr int kSeeds = 3;
  double sum_rad = 0.0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    options.seed = seed;
    sum_rad += RunOdometry(MakeDrive(vehicle, options), vehicle).worst_rad;
  }
  return sum_rad / kSeeds;
}

TEST(VehicleFramesTest, EachErrorIsAsLargeAsAsked) {
  const Vehicle vehicle = Shipped("ackermann_demo");
  const auto mean = [&](auto WheelSimulationOptions::*field, double value) {
    WheelSimulationOptions options = Perfect();
    options.*field = value;
    return MeanHeadingError(vehicle, options);
  };
  using Options = WheelSimulationOptions;
  // Bends of 2 m/s^2 over 36 m a side: 2 * 0.002 * 2 * 75 m of difference on a track of 1.5 m.
  const double turning = mean(&Options::turn_slip_per_mps2, 0.002);
  EXPECT_GT(turning, 0.15);
  EXPECT_LT(turning, 0.6);
  EXPECT_NEAR(mean(&Options::turn_slip_per_mps2, 0.004), 2.0 * turning, 0.2 * turning);
  const double traction = mean(&Options::traction_slip_per_mps2, 0.01);
  EXPECT_GT(traction, 0.005);
  EXPECT_NEAR(mean(&Options::traction_slip_per_mps2, 0.02), 2.0 * traction, 0.2 * traction);
  // Two radii that are off by 0.1 % each over 235 m: 0.22 rad rms at the end.
  const double radius = mean(&Options::radius_sigma, 0.001);
  EXPECT_GT(radius, 0.05);
  EXPECT_LT(radius, 0.5);
}

TEST(VehicleFramesTest, ATrackThatIsWiderTurnsLessThanOdometryThinks) {
  const Vehicle vehicle = Shipped("ackermann_demo");
  const auto plan = DrivePlan::Create(OvalRoute(), Session(), {});
  const VehicleGeometry wider{.track_m = 1.01 * vehicle.odometry.drive.track_m};
  Drive drive{.motions = RollWheels(*plan, SlopedGround(0.0), wider, Perfect().period_ns()),
              .frames = {}};
  drive.frames =
      SimulateWheelFrames(drive.motions, vehicle.odometry, vehicle.dbc, Perfect()).value();
  EXPECT_NEAR(RunOdometry(drive, vehicle).worst_rad, 0.01 * 2.0 * std::numbers::pi, 0.005);
}

/// Decodes a signal of every frame that has it.
std::vector<double> Decode(const Drive& drive, const DbcFile& dbc, const std::string& name) {
  const auto reference = dbc.FindSignal(name).value();
  std::vector<double> values;
  for (const CandumpRecord& record : drive.frames) {
    if (record.frame.id != reference.message->id) continue;
    values.push_back(*DecodeSignal(*reference.signal, record.frame.payload()));
  }
  return values;
}

TEST(VehicleFramesTest, YawRateHasTheBiasAndNoiseAskedFor) {
  const Vehicle vehicle = Shipped("ackermann_demo");
  WheelSimulationOptions options = Perfect();
  options.yaw_rate_bias_radps = 0.01;
  options.yaw_rate_noise_radps = 0.003;
  const Drive drive = MakeDrive(vehicle, options);
  const auto yaw_rates_degps = Decode(drive, vehicle.dbc, "INERTIAL.YAW_RATE");
  ASSERT_EQ(yaw_rates_degps.size(), drive.motions.size());
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < yaw_rates_degps.size(); ++i) {
    const double error =
        yaw_rates_degps[i] * std::numbers::pi / 180.0 - drive.motions[i].yaw_rate_radps;
    sum += error;
    squares += error * error;
  }
  const auto count = static_cast<double>(yaw_rates_degps.size());
  EXPECT_NEAR(sum / count, 0.01, 3.0 * 0.003 / std::sqrt(count));
  EXPECT_NEAR(std::sqrt(squares / count - std::pow(sum / count, 2.0)), 0.003, 0.0002);
}

TEST(VehicleFramesTest, SteeringIsInTheFrames) {
  const Vehicle vehicle = Shipped("ackermann_demo");
  const Drive drive = MakeDrive(vehicle, Perfect());
  const auto angles_deg = Decode(drive, vehicle.dbc, "STEERING.ANGLE");
  ASSERT_EQ(angles_deg.size(), drive.motions.size());
  double largest_deg = 0.0;
  for (std::size_t i = 0; i < angles_deg.size(); ++i) {
    ASSERT_NEAR(angles_deg[i], drive.motions[i].steering_rad * 180.0 / std::numbers::pi, 0.0051);
    largest_deg = std::max(largest_deg, angles_deg[i]);
  }
  EXPECT_GT(largest_deg, 10.0);
}

TEST(VehicleFramesTest, EveryMessageCountsAndHasItsChecksum) {
  const Vehicle vehicle = Shipped("ackermann_demo");
  const Drive drive = MakeDrive(vehicle, Perfect());
  for (const DbcMessage& message : vehicle.dbc.messages()) {
    std::uint64_t expected = 0;
    for (const CandumpRecord& record : drive.frames) {
      if (record.frame.id != message.id) continue;
      const DbcSignal& checksum = *message.FindSignal("CHECKSUM");
      ASSERT_EQ(DecodeBits(checksum, record.frame.payload()),
                Checksum(ChecksumRule::kCrc8J1850, record.frame, checksum));
      expected = (expected + 1) % 16;
      ASSERT_EQ(DecodeBits(*message.FindSignal("COUNTER"), record.frame.payload()), expected);
    }
  }
}

TEST(VehicleFramesTest, NamesAnOptionOutOfRange) {
  const Vehicle vehicle = Shipped("ackermann_demo");
  const auto frames =
      SimulateWheelFrames({}, vehicle.odometry, vehicle.dbc, {.turn_slip_per_mps2 = 2.0});
  ASSERT_FALSE(frames);
  EXPECT_EQ(frames.error().message, "turn_slip is 2, must be in [0, 0.1]");
}

}  // namespace
}  // namespace relocd
