#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include "support/run_program.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

/// Runs reloc-eval as a person would.
Ended RunTool(const std::string& arguments) {
  return RunProgram(RELOC_EVAL " " + arguments);
}

class RelocEvalTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string truth_ =
      folder_.Write("truth.csv", "t_s,x_m,y_m,theta_rad\n0,0,0,0\n1,1,0,0\n2,2,0,0\n");
  std::string estimate_ = folder_.Write(
      "est.csv", "time_ns,x_m,y_m,heading_rad\n0,0,3,0\n1000000000,1,4,0\n2000000000,2,5,0\n");
};

TEST_F(RelocEvalTest, PrintsATable) {
  const Ended ended = RunTool("--truth " + truth_ + " --estimate " + estimate_);
  EXPECT_EQ(ended.exit_code, 0);
  EXPECT_THAT(ended.output, HasSubstr("matched   3 of 3 poses"));
  EXPECT_THAT(ended.output,
              HasSubstr("position [m]                       3     4.000     4.082     4.000     "
                        "5.000     5.000\n"));
}

TEST_F(RelocEvalTest, PrintsJsonOfSomeRowsAndPlotsThem) {
  const std::string plot = folder_.path() + "/plot.png";
  const Ended ended = RunTool("--truth " + truth_ + " --estimate " + estimate_ +
                              " --rows 1:3 --align --json --plot " + plot);
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_THAT(ended.output, HasSubstr("\"position_m\":{\"count\":2,\"mean\":4.5,"));
  EXPECT_GT(std::filesystem::file_size(plot), 1000U);
}

TEST_F(RelocEvalTest, AWrongCommandLineIsUsage) {
  EXPECT_EQ(RunTool("--truth " + truth_).exit_code, 2);
  EXPECT_EQ(RunTool("--help").exit_code, 0);
}

TEST_F(RelocEvalTest, ABadFileIsNamedWithItsLine) {
  const std::string bad = folder_.Write("bad.csv", "time_ns,x_m,y_m\n0,0,0\n0,1,0\n");
  const Ended ended = RunTool("--truth " + truth_ + " --estimate " + bad);
  EXPECT_EQ(ended.exit_code, 78);
  EXPECT_EQ(
      ended.output,
      "reloc eval: " + bad + ": line 3: the time is 0 ns, must be above the row before's 0 ns\n");
}

TEST_F(RelocEvalTest, AMissingFileIsAFailure) {
  EXPECT_EQ(RunTool("--truth " + truth_ + " --estimate " + folder_.path() + "/none").exit_code, 1);
}

}  // namespace
}  // namespace relocd
