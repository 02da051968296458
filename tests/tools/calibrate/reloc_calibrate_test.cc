#include <cmath>
#include <filesystem>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/csv.h"
#include "geometry/pose2.h"
#include "support/random.h"
#include "support/run_program.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::string kVehicles = std::string(RELOCD_SOURCE_DIR) + "/config/vehicles/";

class RelocCalibrateTest : public testing::Test {
 protected:
  static Ended Run(const std::string& arguments) {
    return RunProgram(fmt::format("timeout 60 {} {}", RELOC_CALIBRATE, arguments));
  }

  /// Motions that are 2 % too long, and their truth.
  void WriteDrive() {
    TestRandom random(1);
    std::string odometry = "time_ns,dx_m,dy_m,dtheta_rad\n";
    std::string truth = "time_ns,x_m,y_m,heading_rad\n";
    Pose2 X_WB;
    for (int i = 0; i <= 600; ++i) {
      const double travel_m = i == 0 ? 0.0 : 0.5 + 0.2 * std::sin(0.05 * i);
      const double turn_rad = i == 0 ? 0.0 : 0.03 * std::sin(0.02 * i);
      X_WB = X_WB * Pose2::Exp({travel_m, 0.0, turn_rad});
      const Pose2 measured =
          Pose2::Exp({1.02 * travel_m + random.Normal(0.002), 0.0, turn_rad + random.Normal(2e-4)});
      odometry += fmt::format(
          "{},{},{},{}\n", i * 100'000'000LL, measured.x(), measured.y(), measured.yaw());
      truth += fmt::format("{},{},{},{}\n",
                           i * 100'000'000LL,
                           X_WB.x() + random.Normal(0.02),
                           X_WB.y() + random.Normal(0.02),
                           X_WB.yaw() + random.Normal(0.003));
    }
    folder_.Write("odometry.csv", odometry);
    folder_.Write("truth.csv", truth);
  }

  TemporaryFolder folder_;
};

TEST_F(RelocCalibrateTest, NamesAnOptionThatIsOutOfRange) {
  EXPECT_THAT(Run("umbmark --side-m nan").output,
              HasSubstr("--side-m is nan, must be in (0, 1000]"));
  const std::string drive =
      fmt::format("odometry --config {}ackermann_demo.yaml --can x --reference y ", kVehicles);
  EXPECT_THAT(Run(drive + "--mount nan 0 0").output,
              HasSubstr("--mount is nan 0 0, must be three numbers in [-360, 360]"));
  const Ended empty = Run(drive + "--set can.dbc_file=");
  EXPECT_EQ(empty.exit_code, 78);
  EXPECT_THAT(empty.output, HasSubstr("can.dbc_file is empty, must name a DBC file"));
}

TEST_F(RelocCalibrateTest, FindsTheScaleOfMotionsAndDrawsThem) {
  WriteDrive();
  const Ended ended = Run(fmt::format(
      "odometry --config {0}ackermann_demo.yaml --odometry {1}/odometry.csv --reference "
      "{1}/truth.csv --fit 0:0.6 --judge 0.6:1 --fix mount_x --fix mount_y --plot {1}/plot.png",
      kVehicles,
      folder_.path()));
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_THAT(ended.output, testing::ContainsRegex("left_scale +1 +0.980[0-9]* +[0-9]"));
  EXPECT_THAT(ended.output, testing::ContainsRegex("distance +(1.9|2.0)[0-9] +-?0.[0-2][0-9] %"));
  EXPECT_THAT(ended.output, HasSubstr("    left_scale: 0.98"));
  EXPECT_THAT(ended.output, Not(HasSubstr("mount_x")));
  EXPECT_GT(std::filesystem::file_size(folder_.path() + "/plot.png"), 5000U);
}

/// As of RTK, or of fixes without a heading.
TEST_F(RelocCalibrateTest, NeedsNoHeadings) {
  WriteDrive();
  const CsvTable truth = CsvTable::Read(folder_.path() + "/truth.csv").value();
  std::string positions = "time_ns,x_m,y_m\n";
  for (std::size_t row = 0; row < truth.row_count(); ++row)
    positions +=
        fmt::format("{},{},{}\n", truth.Text(row, 0), truth.Text(row, 1), truth.Text(row, 2));
  const Ended ended = Run(fmt::format(
      "odometry --config {}ackermann_demo.yaml --odometry {}/odometry.csv --reference {}",
      kVehicles,
      folder_.path(),
      folder_.Write("positions.csv", positions)));
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_THAT(ended.output, testing::ContainsRegex("left_scale +1 +0.980[0-9]* +[0-9]"));
  EXPECT_THAT(ended.output, testing::ContainsRegex("distance +(1.9|2.0)[0-9] +-?0.[0-2][0-9] %"));
  EXPECT_THAT(ended.output, Not(HasSubstr("mount_yaw")));
}

TEST_F(RelocCalibrateTest, SaysWhatIsWrong) {
  WriteDrive();
  const std::string common = fmt::format(
      "odometry --config {}ackermann_demo.yaml --reference "
      "{}/truth.csv ",
      kVehicles,
      folder_.path());
  EXPECT_THAT(Run(common).output, HasSubstr("of --can and --odometry one must be given"));
  const std::string odometry = "--odometry " + folder_.path() + "/odometry.csv ";
  EXPECT_THAT(Run(common + odometry + "--fix trak").output,
              HasSubstr("--fix is 'trak', must be one of left_scale, right_scale, track"));
  const Ended part = Run(common + odometry + "--fit 0.5:0.2");
  EXPECT_EQ(part.exit_code, 78);
  EXPECT_THAT(part.output, HasSubstr("--fit is '0.5:0.2', must be BEGIN:END"));
  EXPECT_THAT(Run(common + odometry + "--fit 0:0.01").output,
              HasSubstr("must have at least 10, 0.5 s apart"));
}

TEST_F(RelocCalibrateTest, ExplainsAndEvaluatesSquareRuns) {
  EXPECT_THAT(Run("umbmark --side-m 3").output,
              HasSubstr("Mark a corner of a square of 3 m on a flat, clean floor"));
  const std::string runs = folder_.Write("runs.csv",
                                         "direction,true_x_m,true_y_m,odometry_x_m,odometry_y_m\n"
                                         "clockwise,0.10,-0.10,0,0\nclockwise,0.12,-0.08,0,0\n"
                                         "counter_clockwise,0.10,0.10,0,0\n"
                                         "counter_clockwise,0.08,0.12,0,0\n");
  const std::string config = kVehicles + "differential_demo.yaml";
  const Ended ended = Run(fmt::format("umbmark --config {} --runs {}", config, runs));
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  // alpha is -(0.11 + 0.09) / 16 rad.
  EXPECT_THAT(ended.output, HasSubstr("track factor 0.992105"));
  EXPECT_THAT(ended.output, HasSubstr("    track_m: 1.488158  # was 1.5"));
  const std::string wrong = folder_.Write(
      "wrong.csv", "direction,true_x_m,true_y_m,odometry_x_m,odometry_y_m\nleft,0,0,0,0\n");
  EXPECT_THAT(Run(fmt::format("umbmark --config {} --runs {}", config, wrong)).output,
              HasSubstr("line 2: direction is 'left', must be clockwise or counter_clockwise"));
}

TEST_F(RelocCalibrateTest, CalibratesARealDrive) {
  const std::string data = SharedData("comma_can");
  if (data.empty()) GTEST_SKIP() << SharedDataReason("comma_can");
  const Ended ended = Run(fmt::format(
      "odometry --config {0}toyota_rav4.yaml --can {1}/can0_vehicle_bus.log --reference "
      "{1}/poses_tum.txt --fit 0:0.5 --judge 0.5:1",
      kVehicles,
      data));
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_THAT(ended.output, testing::ContainsRegex("track +1.57  cannot be known from this drive"));
  EXPECT_THAT(ended.output, testing::ContainsRegex("distance +-0.[0-9]+ +-?0.[0-2][0-9] %"));
}

}  // namespace
}  // namespace relocd
