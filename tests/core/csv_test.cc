#include "core/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kTable =
    "# odometry\n"
    "time_ns,x_m, y_m\n"
    "\n"
    "10,1.5,-2\r\n"
    "20, 2.5 ,\n";

TEST(CsvTableTest, ReadsCellsByColumn) {
  const auto table = CsvTable::Parse(kTable, "odo.csv");
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->row_count(), 2U);
  const auto columns = table->Columns({"y_m", "time_ns"});
  ASSERT_TRUE(columns);
  EXPECT_THAT(*columns, ElementsAre(2U, 0U));
  EXPECT_DOUBLE_EQ(table->Double(0, 2).value(), -2.0);
  EXPECT_EQ(table->Int64(1, 0).value(), 20);
  EXPECT_FALSE(table->OptionalDouble(1, 2).value().has_value());
}

TEST(CsvTableTest, NamesAMissingColumnAndTheHeaderThatWasFound) {
  const auto table = CsvTable::Parse(kTable, "odo.csv");
  const auto columns = table->Columns({"heading_rad"});
  ASSERT_FALSE(columns);
  EXPECT_EQ(columns.error().message,
            "odo.csv: line 1: the header has no column 'heading_rad', it has time_ns,x_m,y_m");
}

TEST(CsvTableTest, NamesLineColumnAndTextOfWhatIsNoNumber) {
  const auto table = CsvTable::Parse("time_ns,x_m\n1,abc\n2,nan\n3.5,1\n", "odo.csv");
  EXPECT_EQ(table->Double(0, 1).error().message,
            "odo.csv: line 2: x_m is 'abc', must be a finite number");
  EXPECT_THAT(table->Double(1, 1).error().message, HasSubstr("line 3: x_m is 'nan'"));
  EXPECT_THAT(table->Int64(2, 0).error().message,
              HasSubstr("time_ns is '3.5', must be an integer"));
}

TEST(CsvTableTest, RefusesARowOfAnotherLength) {
  const auto table = CsvTable::Parse("a,b\n1,2\n1,2,3\n", "x.csv");
  ASSERT_FALSE(table);
  EXPECT_EQ(table.error().message, "x.csv: line 3: has 3 cells, must have 2 as the header");
  EXPECT_EQ(table.error().kind, ErrorKind::kInvalidInput);
}

TEST(CsvTableTest, RefusesAFileWithoutAHeader) {
  EXPECT_FALSE(CsvTable::Parse("# nothing\n\n", "x.csv"));
}

TEST(CsvTableTest, NamesAFileThatIsNotThere) {
  const auto table = CsvTable::Read("/nonexistent/x.csv");
  ASSERT_FALSE(table);
  EXPECT_THAT(table.error().message, HasSubstr("/nonexistent/x.csv"));
}

}  // namespace
}  // namespace relocd
