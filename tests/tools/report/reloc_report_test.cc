#include <algorithm>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "made_drive.h"
#include "support/run_program.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

/// Runs reloc-report as a person would.
Ended RunTool(const std::string& arguments) {
  return RunProgram(RELOC_REPORT " " + arguments);
}

class RelocReportTest : public testing::Test {
 protected:
  RelocReportTest() {
    const MadeDrive drive;
    folder_.Write("truth.csv", drive.truth);
    folder_.Write("odometry.csv", drive.odometry);
    folder_.Write("camera.csv", drive.camera);
    folder_.Write("fused.csv", drive.fused);
  }

  [[nodiscard]] std::string Arguments() const {
    std::string arguments = "--out " + folder_.path() + "/out";
    for (const std::string name : {"truth", "odometry", "camera", "fused"})
      arguments += fmt::format(" --{} {}/{}.csv", name, folder_.path(), name);
    return arguments;
  }

  TemporaryFolder folder_;
};

TEST_F(RelocReportTest, WritesTextPagePlotAndJson) {
  const Ended ended = RunTool(Arguments());
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_THAT(ended.output, HasSubstr("odometry alone, from the true start"));
  EXPECT_EQ(ReadFile(folder_.path() + "/out/report.txt").value(), ended.output);
  EXPECT_THAT(ReadFile(folder_.path() + "/out/report.html").value(), StartsWith("<!DOCTYPE html>"));
  EXPECT_THAT(ReadFile(folder_.path() + "/out/drive.png").value(), HasSubstr("PNG"));
  EXPECT_EQ(RunTool(Arguments() + " --json").output,
            ReadFile(folder_.path() + "/out/report.json").value());
}

TEST_F(RelocReportTest, AMissingFileIsOneLineAndAWrongInput) {
  std::filesystem::remove(folder_.path() + "/camera.csv");
  const Ended ended = RunTool(Arguments());
  EXPECT_EQ(ended.exit_code, 78);
  EXPECT_THAT(ended.output, StartsWith("reloc report: "));
  EXPECT_THAT(ended.output, HasSubstr("camera.csv"));
  EXPECT_EQ(std::ranges::count(ended.output, '\n'), 1);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() + "/out"));
}

TEST_F(RelocReportTest, AMissingColumnAnEmptyTableAndOtherTimesAreWrongInputs) {
  folder_.Write("fused.csv", "time_ns,x_m,heading_rad\n0,0,0\n");
  EXPECT_EQ(RunTool(Arguments()).exit_code, 78);
  folder_.Write("fused.csv", "time_ns,x_m,y_m,heading_rad\n");
  const Ended empty = RunTool(Arguments());
  EXPECT_EQ(empty.exit_code, 78);
  EXPECT_THAT(empty.output, HasSubstr("fused.csv: has no rows"));
  folder_.Write("fused.csv", "time_ns,x_m,y_m,heading_rad\n99000000000,0,0,0\n");
  const Ended later = RunTool(Arguments());
  EXPECT_EQ(later.exit_code, 78);
  EXPECT_THAT(later.output, HasSubstr("no estimate has a truth at its time"));
}

TEST_F(RelocReportTest, AMissingLogOrDataSetIsAWrongInput) {
  for (const char* const option : {"--log", "--dataset"}) {
    const Ended ended = RunTool(fmt::format("{} {} {}/none", Arguments(), option, folder_.path()));
    EXPECT_EQ(ended.exit_code, 78);
    EXPECT_THAT(ended.output, HasSubstr("/none"));
  }
}

TEST_F(RelocReportTest, AWrongCommandLineIsUsage) {
  EXPECT_EQ(RunTool("--truth x").exit_code, 2);
  EXPECT_EQ(RunTool(Arguments() + " --teach-dataset x").exit_code, 2);
  EXPECT_EQ(RunTool(Arguments() + " --top-view x.png").exit_code, 2);
  EXPECT_EQ(RunTool("--help").exit_code, 0);
}

}  // namespace
}  // namespace relocd
