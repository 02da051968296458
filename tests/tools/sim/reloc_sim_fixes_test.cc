#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/csv.h"
#include "core/file.h"
#include "smoothing/motion_log_csv.h"
#include "support/run_program.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

class RelocSimFixesTest : public testing::Test {
 protected:
  /// Runs reloc-sim as a person would.
  [[nodiscard]] Ended RunTool(const std::string& arguments) const {
    return RunProgram(RELOC_SIM " fixes --truth " + truth_ + " --out " + out_ + " " + arguments);
  }

  /// What the tool says of a truth that is wrong.
  [[nodiscard]] Ended RunOn(const std::string& truth) {
    truth_ = folder_.Write("wrong.csv", truth);
    return RunTool("");
  }

  /// 100 s at 10 Hz along x, at 2 m/s.
  static std::string Truth() {
    std::string text = "time_ns,x_m,y_m,heading_rad\n";
    for (int i = 0; i <= 1000; ++i)
      text += fmt::format("{},{},5,0.25\n", i * 100'000'000L, 0.2 * i);
    return text;
  }

  TemporaryFolder folder_;
  std::string truth_ = folder_.Write("truth.csv", Truth());
  std::string out_ = folder_.path() + "/fixes.csv";
};

TEST_F(RelocSimFixesTest, WritesFixesThatAreAsFarOffAsTheirCovarianceSays) {
  const Ended ended = RunTool("--seed 3 --rate-hz 10 --sigma-m 0.5 --heading-sigma-rad 0.05");
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_EQ(ended.output, "1001 fixes, 0 of them outliers\n");
  const auto table = CsvTable::Read(out_);
  ASSERT_TRUE(table) << table.error().message;
  const auto columns =
      table->Columns({"time_ns", "x_m", "y_m", "heading_rad", "cov_xx", "cov_yy", "cov_tt"});
  ASSERT_TRUE(columns);
  double squares = 0.0;
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const auto value = [&](std::size_t column) {
      return table->Double(row, (*columns)[column]).value();
    };
    const double x_true_m = 2.0 * value(0) * 1e-9;
    squares += std::pow(value(1) - x_true_m, 2) / value(4);
    squares += std::pow(value(2) - 5.0, 2) / value(5);
    squares += std::pow(value(3) - 0.25, 2) / value(6);
  }
  EXPECT_NEAR(squares / (3.0 * static_cast<double>(table->row_count())), 1.0, 0.08);
}

TEST_F(RelocSimFixesTest, WithoutAHeadingTheCellIsEmpty) {
  ASSERT_EQ(RunTool("--rate-hz 1 --outlier-share 0.3").exit_code, 0);
  const auto table = CsvTable::Read(out_);
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->row_count(), 101U);
  const auto column = table->FindColumn("heading_rad");
  ASSERT_TRUE(column);
  EXPECT_FALSE(table->OptionalDouble(0, *column).value());
}

TEST_F(RelocSimFixesTest, TheSmootherReadsThem) {
  ASSERT_EQ(RunTool("--outlier-share 0.3 --bias-sigma-m 0.2").exit_code, 0);
  const auto fixes = ParseFixesCsv(ReadFile(out_).value(), out_, SmootherConfig{});
  ASSERT_TRUE(fixes) << fixes.error().message;
  EXPECT_EQ(fixes->size(), 501U);
  EXPECT_FALSE(fixes->front().has_heading);
  EXPECT_NEAR(fixes->front().covariance(0, 0), 0.25, 1e-12);
}

TEST_F(RelocSimFixesTest, TheSameSeedWritesTheSameBytes) {
  const std::string options = "--outlier-share 0.5 --bias-sigma-m 1 --seed ";
  ASSERT_EQ(RunTool(options + "7").exit_code, 0);
  const std::string first = ReadFile(out_).value();
  ASSERT_EQ(RunTool(options + "7").exit_code, 0);
  EXPECT_EQ(ReadFile(out_).value(), first);
  ASSERT_EQ(RunTool(options + "8").exit_code, 0);
  EXPECT_NE(ReadFile(out_).value(), first);
}

TEST_F(RelocSimFixesTest, NamesFileLineAndFieldOfATruthThatIsWrong) {
  const std::string header = "time_ns,x_m,y_m,heading_rad\n";
  struct Case {
    const char* truth;
    const char* says;
  };
  for (const Case& wrong :
       {Case{"0,0,0,0\n5,nan,0,0\n", "line 3: x_m is 'nan', must be a finite number"},
        Case{"0,0,0,0\n5,1,0\n", "line 3: has 3 cells, must have 4 as the header"},
        Case{"0.5,0,0,0\n", "line 2: time_ns is '0.5', must be an integer"},
        Case{"9,0,0,0\n9,1,0,0\n", "line 3: time_ns is 9, must be above the row before's 9"},
        Case{"", "has no rows, must have at least one"}}) {
    const Ended ended = RunOn(header + wrong.truth);
    EXPECT_EQ(ended.exit_code, 78) << ended.output;
    EXPECT_THAT(ended.output, HasSubstr("wrong.csv: " + std::string(wrong.says)));
    EXPECT_EQ(std::count(ended.output.begin(), ended.output.end(), '\n'), 1) << ended.output;
  }
  const Ended ended = RunOn("time_ns,x,y,heading_rad\n0,0,0,0\n");
  EXPECT_EQ(ended.exit_code, 78);
  EXPECT_THAT(ended.output, HasSubstr("wrong.csv: line 1: the header has no column 'x_m'"));
  EXPECT_FALSE(ReadFile(out_));  // nothing is left of what failed
}

TEST_F(RelocSimFixesTest, NamesAnOptionThatIsOutOfRangeAndWhatIsAllowed) {
  const Ended ended = RunTool("--outlier-share 1.5");
  EXPECT_EQ(ended.exit_code, 78);
  EXPECT_THAT(ended.output, HasSubstr("outlier_share is 1.5, must be in [0, 1]"));
  EXPECT_EQ(RunTool("--rate-hz fast").exit_code, 2);
  EXPECT_EQ(RunTool("--rate 5").exit_code, 2);
  truth_ = folder_.path() + "/missing.csv";
  EXPECT_EQ(RunTool("").exit_code, 1);
}

}  // namespace
}  // namespace relocd
