#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/csv.h"
#include "core/file.h"
#include "support/run_program.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

/// A line of KITTI's poses: a camera that looks `yaw_rad` to the left of the first one's view, `z`
/// ahead of it and `x` to its right.
std::string KittiLine(double yaw_rad, double x, double z) {
  const double c = std::cos(yaw_rad);
  const double s = std::sin(yaw_rad);
  return fmt::format("{} 0 {} {} 0 1 0 0.1 {} 0 {} {}\n", c, -s, x, s, c, z);
}

class RelocImportKittiTest : public testing::Test {
 protected:
  /// Runs reloc-import as a person would.
  [[nodiscard]] Ended RunOn(const std::string& poses, const std::string& more = "") {
    const std::string path = folder_.Write("poses.txt", poses);
    return RunProgram(RELOC_IMPORT " kitti --poses " + path + " --out " + out_ + " " + more);
  }

  TemporaryFolder folder_;
  std::string out_ = folder_.path() + "/path.csv";
};

TEST_F(RelocImportKittiTest, WritesThePathInThePlane) {
  // A quarter of a circle of 10 m to the left.
  std::string poses;
  constexpr int kSteps = 90;
  const double step_rad = 0.5 * std::acos(-1.0) / kSteps;
  for (int i = 0; i <= kSteps; ++i) {
    const double yaw = i * step_rad;
    poses += KittiLine(yaw, -10.0 * (1.0 - std::cos(yaw)), 10.0 * std::sin(yaw));
  }
  const Ended ended = RunOn(poses);
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  const auto table = CsvTable::Read(out_);
  ASSERT_TRUE(table) << table.error().message;
  const auto columns = table->Columns({"t_s", "x_m", "y_m", "theta_rad"});
  ASSERT_TRUE(columns);
  ASSERT_EQ(table->row_count(), 91U);
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const double yaw = static_cast<double>(row) * step_rad;
    const auto value = [&](std::size_t column) {
      return table->Double(row, (*columns)[column]).value();
    };
    EXPECT_NEAR(value(0), 0.1 * static_cast<double>(row), 1e-12);  // 10 Hz
    EXPECT_NEAR(value(1), 10.0 * std::sin(yaw), 1e-9);             // ahead
    EXPECT_NEAR(value(2), 10.0 * (1.0 - std::cos(yaw)), 1e-9);     // to the left
    EXPECT_NEAR(value(3), yaw, 1e-9);
  }
}

TEST_F(RelocImportKittiTest, TakesItsTimesFromTheRate) {
  ASSERT_EQ(RunOn(KittiLine(0.0, 0.0, 0.0) + KittiLine(0.0, 0.0, 1.0), "--rate-hz 4").exit_code, 0);
  EXPECT_THAT(ReadFile(out_).value(), HasSubstr("\n0.25,1,"));
}

TEST_F(RelocImportKittiTest, NamesFileLineAndNumberThatIsWrong) {
  const std::string good = KittiLine(0.0, 0.0, 0.0);
  struct Case {
    std::string poses;
    const char* says;
  };
  for (const Case& wrong :
       {Case{good + "1 0 0 0 0 1 0 0 0 0 1\n", "line 2: has 11 numbers, must have 12"},
        Case{good + good + "1 0 0 0 0 1 0 0 0 0 1 0 0\n", "line 3: has 13 numbers, must have 12"},
        Case{good + "1 0 0 0 0 1 0 0 0 0 1 x\n", "line 2: 'x' is no finite number"},
        Case{good + "1 0 0 inf 0 1 0 0 0 0 1 0\n", "line 2: 'inf' is no finite number"},
        Case{good + "\n" + good, "line 2: has 0 numbers, must have 12"},
        Case{good + "2 0 0 0 0 2 0 0 0 0 2 0\n",
             "line 2: the camera's axis (0, 0, 2) has the length 2, must have 1"},
        Case{"", "has no lines, must have at least one"}}) {
    const Ended ended = RunOn(wrong.poses);
    EXPECT_EQ(ended.exit_code, 78) << ended.output;
    EXPECT_THAT(ended.output,
                HasSubstr("reloc import kitti: " + folder_.path() + "/poses.txt: " + wrong.says));
    EXPECT_EQ(std::count(ended.output.begin(), ended.output.end(), '\n'), 1) << ended.output;
    EXPECT_FALSE(ReadFile(out_));  // nothing is left of what failed
  }
}

TEST_F(RelocImportKittiTest, RefusesARateThatIsNone) {
  for (const char* rate : {"0", "-1", "nan", "inf"}) {
    const Ended ended = RunOn(KittiLine(0.0, 0.0, 0.0), std::string("--rate-hz ") + rate);
    EXPECT_EQ(ended.exit_code, 78) << ended.output;
    EXPECT_THAT(ended.output,
                HasSubstr(fmt::format("--rate-hz is {}, must be > 0 and finite", rate)));
  }
  EXPECT_EQ(RunOn("", "--rate-hz fast").exit_code, 2);
}

TEST_F(RelocImportKittiTest, AFileThatIsNotThereIsNoInput) {
  const Ended ended =
      RunProgram(RELOC_IMPORT " kitti --poses /nowhere/poses.txt --out " + folder_.path() + "/x");
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_THAT(ended.output, HasSubstr("/nowhere/poses.txt"));
}

}  // namespace
}  // namespace relocd
