#include "calibration/odometry_calibration.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calibration/drive_judgement.h"
#include "config/config.h"
#include "simulation/wheel_simulator.h"
#include "support/random.h"

namespace relocd {
namespace {

/// A car, and what it is taken to be before it is calibrated.
struct Car {
  OdometryConfig truth;
  OdometryConfig config;
  DbcFile dbc;
  DriveParameters reference;  ///< Mounting and time offset.
};

Car MakeCar() {
  const std::string folder = std::string(RELOCD_SOURCE_DIR) + "/config/vehicles/";
  const Config config = LoadConfig(folder + "ackermann_demo.yaml", {}).value();
  Car car{.truth = config.odometry,
          .config = config.odometry,
          .dbc = DbcFile::Read(config.can.dbc_file).value(),
          .reference = {}};
  for (OdometryConfig* odometry : {&car.truth, &car.config}) {
    odometry->steering.signal = "STEERING.ANGLE";
    odometry->steering.ratio = 1.0;
    odometry->yaw_rate.signal = "INERTIAL.YAW_RATE";
  }
  car.truth.drive.left_scale = 1.012;
  car.truth.drive.right_scale = 1.009;
  car.truth.drive.front_left_scale = 1.0;
  car.truth.drive.track_m = 1.55;
  car.truth.drive.wheel_sigma_m_per_sqrt_m = 0.006;
  car.reference.time_offset_s = 0.06;
  car.reference.mount_x_m = 1.2;
  car.reference.mount_y_m = -0.3;
  car.reference.mount_yaw_rad = 0.02;
  return car;
}

constexpr double kYawRateBias = 0.015;
constexpr double kReferenceSigmaM = 0.05;
constexpr double kReferenceSigmaRad = 0.01;

/// 90 s at 5 m/s to 9 m/s, in bends to both sides, or straight on.
Trajectory2 Drive(bool is_straight) {
  Trajectory2 X_WBs;
  Pose2 X_WB(10.0, -5.0, 0.7);
  constexpr std::int64_t kStepNs = 50'000'000;
  for (int i = 0; i <= 1800; ++i) {
    const double time_s = 0.05 * i;
    X_WBs.push_back({.time_ns = i * kStepNs, .X_WB = X_WB});
    const double speed_mps = 7.0 + 2.0 * std::sin(0.31 * time_s);
    const double rate_radps =
        is_straight ? 0.0 : 0.35 * std::sin(0.23 * time_s) + 0.2 * std::sin(0.71 * time_s);
    X_WB = X_WB * Pose2::Exp({0.05 * speed_mps, 0.0, 0.05 * rate_radps});
  }
  return X_WBs;
}

struct Recorded {
  OdometryRecording recording;
  std::vector<ReferencePose> references;
};

Recorded Record(const Car& car, const Trajectory2& X_WBs, unsigned seed) {
  const WheelSimulationOptions options{.seed = seed,
                                       .rate_hz = 50.0,
                                       .yaw_rate_bias_radps = kYawRateBias,
                                       .yaw_rate_noise_radps = 0.003};
  const auto motions =
      RollWheels(X_WBs,
                 {.track_m = car.truth.drive.track_m, .wheelbase_m = car.truth.drive.wheelbase_m},
                 options.period_ns());
  const auto frames = SimulateWheelFrames(motions, car.truth, car.dbc, options);
  EXPECT_TRUE(frames) << frames.error().message;
  auto recorder = OdometryRecorder::Create(car.config, car.dbc, {});
  EXPECT_TRUE(recorder) << recorder.error().message;
  for (const CandumpRecord& record : *frames)
    recorder->Handle(record.frame);
  Recorded recorded{.recording = recorder->recording(), .references = {}};
  TestRandom random(seed + 1000);
  const Pose2 X_BR(car.reference.mount_x_m, car.reference.mount_y_m, car.reference.mount_yaw_rad);
  for (const TimedPose2& pose : X_WBs) {
    const Pose2 noise(random.Normal(kReferenceSigmaM),
                      random.Normal(kReferenceSigmaM),
                      random.Normal(kReferenceSigmaRad));
    recorded.references.push_back(
        {.time_s = 1e-9 * static_cast<double>(pose.time_ns - recorded.recording.origin_ns) -
                   car.reference.time_offset_s,
         .X_WR = pose.X_WB * X_BR * noise});
  }
  return recorded;
}

const CalibratedParameter& Find(const OdometryCalibration& calibration, const std::string& name) {
  const auto found = std::find_if(calibration.parameters.begin(),
                                  calibration.parameters.end(),
                                  [&](const auto& parameter) { return parameter.name == name; });
  EXPECT_NE(found, calibration.parameters.end()) << name;
  return *found;
}

struct Truth {
  const char* name;
  double value;
};

std::vector<Truth> Truths(const Car& car) {
  return {{"left_scale", car.truth.drive.left_scale},
          {"right_scale", car.truth.drive.right_scale},
          {"track", car.truth.drive.track_m},
          {"time_offset", car.reference.time_offset_s},
          {"mount_x", car.reference.mount_x_m},
          {"mount_y", car.reference.mount_y_m},
          {"mount_yaw", car.reference.mount_yaw_rad},
          {"yaw_rate_scale", 1.0},
          {"yaw_rate_bias", kYawRateBias}};
}

/// Over several drives every parameter is off by as much as its standard deviation says.
TEST(OdometryCalibrationTest, FindsKnownParametersWithinItsStandardDeviations) {
  const Car car = MakeCar();
  const Trajectory2 X_WBs = Drive(false);
  double squared = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Recorded recorded = Record(car, X_WBs, seed);
    const auto calibration =
        CalibrateOdometry(recorded.recording, recorded.references, car.config, {});
    ASSERT_TRUE(calibration) << calibration.error().message;
    for (const Truth& truth : Truths(car)) {
      const CalibratedParameter& parameter = Find(*calibration, truth.name);
      EXPECT_TRUE(parameter.is_known) << truth.name;
      const double deviations = (parameter.after - truth.value) / parameter.sigma;
      EXPECT_LT(std::abs(deviations), 4.0)
          << truth.name << " " << parameter.after << " +- " << parameter.sigma << ", truly "
          << truth.value << ", seed " << seed;
      squared += deviations * deviations;
      ++count;
    }
    EXPECT_LT(Find(*calibration, "left_scale").sigma, 0.001);
    EXPECT_LT(Find(*calibration, "track").sigma, 0.02);
    // The noise is what was put in, as well as one drive tells it.
    EXPECT_NEAR(calibration->noise.reference_sigma_m, kReferenceSigmaM, 0.02);
    EXPECT_NEAR(calibration->noise.reference_sigma_rad, kReferenceSigmaRad, 0.004);
    EXPECT_NEAR(calibration->noise.wheel_sigma_m_per_sqrt_m, 0.006, 0.003);
    EXPECT_NEAR(calibration->residual_rms, 1.0, 0.2);
    // The steering is exact but for its last bit, late by a frame, and the front wheels roll truly.
    EXPECT_NEAR(Find(*calibration, "steering_ratio").after, 1.0, 0.03);
    EXPECT_NEAR(Find(*calibration, "front_left_scale").after, 1.0, 0.002);
  }
  const double rms = std::sqrt(squared / count);
  EXPECT_GT(rms, 0.5);
  EXPECT_LT(rms, 1.6);
}

TEST(OdometryCalibrationTest, MakesTheSameCarDriveTrulyOnAnotherWay) {
  const Car car = MakeCar();
  const Recorded recorded = Record(car, Drive(false), 1);
  const auto calibration =
      CalibrateOdometry(recorded.recording, recorded.references, car.config, {});
  ASSERT_TRUE(calibration) << calibration.error().message;
  const auto judge = [&](const OdometryConfig& config) {
    Car other = car;
    other.config = config;
    Trajectory2 X_WBs = Drive(false);
    for (TimedPose2& pose : X_WBs)  // the mirrored way
      pose.X_WB = Pose2(pose.X_WB.x(), -pose.X_WB.y(), -pose.X_WB.yaw());
    const Recorded again = Record(other, X_WBs, 77);
    return JudgeOdometry(again.recording.X_OBs,
                         again.recording.origin_ns,
                         SmoothReference(
                             Record(car, X_WBs, 77).recording, again.references, *calibration, 0.5),
                         car.reference.time_offset_s)
        .value();
  };
  const DriveJudgement before = judge(car.config);
  const DriveJudgement after = judge(ApplyCalibration(car.config, *calibration));
  EXPECT_GT(std::abs(before.distance_error), 0.008);
  EXPECT_LT(std::abs(after.distance_error), 0.003);
  EXPECT_GT(before.worst_position_error_m, 3.0 * after.worst_position_error_m);
}

TEST(OdometryCalibrationTest, SaysThatAStraightRoadTellsNothingOfTheTrack) {
  const Car car = MakeCar();
  const Recorded recorded = Record(car, Drive(true), 3);
  const auto calibration =
      CalibrateOdometry(recorded.recording, recorded.references, car.config, {});
  ASSERT_TRUE(calibration) << calibration.error().message;
  for (const char* name : {"track", "yaw_rate_scale"}) {
    const CalibratedParameter& parameter = Find(*calibration, name);
    EXPECT_FALSE(parameter.is_known) << name << " " << parameter.sigma;
    EXPECT_EQ(parameter.after, parameter.before) << name;
  }
  EXPECT_EQ(calibration->drive.track_m, car.config.drive.track_m);
  // What a straight road does tell: how far, and how much more the one side than the other.
  const CalibratedParameter& left = Find(*calibration, "left_scale");
  const CalibratedParameter& right = Find(*calibration, "right_scale");
  EXPECT_TRUE(left.is_known && right.is_known);
  EXPECT_NEAR(0.5 * (left.after + right.after), 1.0105, 0.001);
  EXPECT_NEAR(right.after - left.after, -0.003, 0.001);
}

/// The references with three of ten far off, the first one among them.
Recorded WithOutliers(Recorded recorded) {
  TestRandom random(9);
  for (std::size_t i = 0; i < recorded.references.size(); ++i) {
    if (i != 0 && random.Integer(0, 9) >= 3) continue;
    recorded.references[i].X_WR =
        recorded.references[i].X_WR * Pose2(random.Normal(20.0), random.Normal(20.0), 0.5);
  }
  return recorded;
}

TEST(OdometryCalibrationTest, ReferencesThatAreFarOffDoNotCount) {
  const Car car = MakeCar();
  const Recorded recorded = WithOutliers(Record(car, Drive(false), 4));
  const auto calibration =
      CalibrateOdometry(recorded.recording, recorded.references, car.config, {});
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_GT(calibration->outliers, 40);
  EXPECT_NEAR(calibration->residual_rms, 1.0, 0.2);
  EXPECT_NEAR(calibration->noise.wheel_sigma_m_per_sqrt_m, 0.006, 0.003);
  for (const Truth& truth : Truths(car)) {
    const CalibratedParameter& parameter = Find(*calibration, truth.name);
    EXPECT_NEAR(parameter.after, truth.value, 4.0 * parameter.sigma) << truth.name;
  }
}

/// Neither outliers nor noise nor missing headings are left in what odometry is judged by.
TEST(OdometryCalibrationTest, JudgesByWhereTheBodyWas) {
  const Car car = MakeCar();
  const Trajectory2 X_WBs = Drive(false);
  Recorded recorded = WithOutliers(Record(car, X_WBs, 4));
  for (ReferencePose& reference : recorded.references)
    reference.has_heading = false;
  const auto calibration =
      CalibrateOdometry(recorded.recording,
                        recorded.references,
                        car.config,
                        {.initial = car.reference, .fixed = {"mount_x", "mount_y"}});
  ASSERT_TRUE(calibration) << calibration.error().message;
  const auto bodies = SmoothReference(recorded.recording, recorded.references, *calibration, 0.5);
  ASSERT_GT(bodies.size(), 100U);
  double squared_m2 = 0.0;
  for (const ReferencePose& body : bodies) {
    const auto time_ns = recorded.recording.origin_ns +
                         std::llround(1e9 * (body.time_s + calibration->drive.time_offset_s));
    const auto X_WB = Interpolate(X_WBs, time_ns, 1'000'000'000);
    ASSERT_TRUE(X_WB);
    const Pose2 error = X_WB->Inverse() * body.X_WR;
    EXPECT_LT(std::abs(error.yaw()), 0.04) << body.time_s;
    squared_m2 += error.translation().squaredNorm();
  }
  // A single reference is off by 0.07 m.
  EXPECT_LT(std::sqrt(squared_m2 / static_cast<double>(bodies.size())), 0.05);
}

/// Without noise of its own the yaw rate is not given one of nothing, which would be believed.
TEST(OdometryCalibrationTest, KeepsANoiseThatTheReferenceHides) {
  const Car car = MakeCar();
  Recorded recorded = Record(car, Drive(false), 5);
  for (std::size_t i = 0; i < recorded.recording.samples.size(); ++i) {
    auto& sample = recorded.recording.samples[i];
    const auto time_ns = recorded.recording.origin_ns + std::llround(1e9 * sample.time_s);
    const auto X_WB = Interpolate(Drive(false), time_ns, 1'000'000'000);
    if (X_WB) sample.yaw_rad = X_WB->yaw();
  }
  const auto calibration =
      CalibrateOdometry(recorded.recording, recorded.references, car.config, {});
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_FALSE(calibration->has_yaw_rate_noise);
  EXPECT_TRUE(calibration->has_wheel_noise);
  const OdometryConfig applied = ApplyCalibration(car.config, *calibration);
  EXPECT_EQ(applied.yaw_rate.noise_rad_per_sqrt_s, car.config.yaw_rate.noise_rad_per_sqrt_s);
  EXPECT_NE(applied.drive.wheel_sigma_m_per_sqrt_m, car.config.drive.wheel_sigma_m_per_sqrt_m);
}

/// The front wheels are as large as where the reference is; what they do elsewhere, slipping, or in
/// a few odd seconds says nothing.
TEST(OdometryCalibrationTest, FindsTheFrontWheelsWhereTheReferenceIs) {
  const Car car = MakeCar();
  Recorded recorded = Record(car, Drive(false), 5);
  std::erase_if(recorded.references, [](const auto& pose) { return pose.time_s > 60.0; });
  OdometryRecording& recording = recorded.recording;
  double added_m = 0.0;
  for (std::size_t i = 1; i < recording.samples.size(); ++i) {
    auto& sample = recording.samples[i];
    const bool is_odd = sample.time_s > 65.0 || (sample.time_s > 10.0 && sample.time_s < 12.0);
    sample.is_slipping = sample.time_s > 20.0 && sample.time_s < 25.0;
    if (is_odd || sample.is_slipping) added_m += 0.02;
    sample.travel_m[2] = sample.travel_m[2] / 1.004 + added_m;
    sample.travel_m[3] = sample.travel_m[3] / 1.001 + added_m;
  }
  const auto calibration = CalibrateOdometry(recording, recorded.references, car.config, {});
  ASSERT_TRUE(calibration) << calibration.error().message;
  const double left = Find(*calibration, "front_left_scale").after;
  const double right = Find(*calibration, "front_right_scale").after;
  EXPECT_NEAR(left, 1.004, 0.002);
  EXPECT_NEAR(left - right, 0.003, 0.0005);
}

TEST(OdometryCalibrationTest, NeedsNoHeadingsOfTheReference) {
  const Car car = MakeCar();
  Recorded recorded = Record(car, Drive(false), 6);
  for (ReferencePose& reference : recorded.references) {
    reference.has_heading = false;
    reference.X_WR = Pose2(reference.X_WR.x(), reference.X_WR.y(), 0.0);
  }
  const auto calibration =
      CalibrateOdometry(recorded.recording, recorded.references, car.config, {});
  ASSERT_TRUE(calibration) << calibration.error().message;
  for (const char* name : {"left_scale", "right_scale", "track", "time_offset"}) {
    const CalibratedParameter& parameter = Find(*calibration, name);
    const auto truths = Truths(car);
    const auto truth = std::find_if(
        truths.begin(), truths.end(), [&](const Truth& t) { return std::string(t.name) == name; });
    EXPECT_NEAR(parameter.after, truth->value, 4.0 * parameter.sigma) << name;
  }
}

TEST(OdometryCalibrationTest, KeepsWhatIsFixed) {
  const Car car = MakeCar();
  const Recorded recorded = Record(car, Drive(false), 7);
  const auto calibration = CalibrateOdometry(recorded.recording,
                                             recorded.references,
                                             car.config,
                                             {.initial = car.reference, .fixed = {"track"}});
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_EQ(calibration->drive.track_m, car.config.drive.track_m);
  EXPECT_THAT(CalibrationParameterNames(), testing::Contains("track"));
}

TEST(OdometryCalibrationTest, SaysWhenThereIsTooLittle) {
  const Car car = MakeCar();
  Recorded recorded = Record(car, Drive(false), 8);
  recorded.references.resize(60);
  const auto calibration =
      CalibrateOdometry(recorded.recording, recorded.references, car.config, {});
  ASSERT_FALSE(calibration);
  EXPECT_THAT(calibration.error().message,
              testing::HasSubstr("must have at least 10, 0.5 s apart, over 5 m"));
}

}  // namespace
}  // namespace relocd
