#include "core/index_range.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

struct Case {
  std::string text;
  IndexRange range;
};

TEST(IndexRangeTest, ReadsAHalfOpenRange) {
  const std::initializer_list<Case> cases = {{"", {0, 10}},
                                             {":", {0, 10}},
                                             {"3:7", {3, 7}},
                                             {"3:", {3, 10}},
                                             {":7", {0, 7}},
                                             {" 3 : 7 ", {3, 7}},
                                             {"3:99", {3, 10}},
                                             {"9:10", {9, 10}}};
  for (const auto& [text, range] : cases) {
    const auto parsed = ParseIndexRange(text, 10);
    ASSERT_TRUE(parsed) << parsed.error().message;
    EXPECT_EQ(*parsed, range) << text;
  }
}

TEST(IndexRangeTest, ContainsItsFirstButNotItsEnd) {
  const IndexRange range{3, 7};
  EXPECT_EQ(range.size(), 4U);
  EXPECT_FALSE(range.Contains(2));
  EXPECT_TRUE(range.Contains(3));
  EXPECT_TRUE(range.Contains(6));
  EXPECT_FALSE(range.Contains(7));
}

TEST(IndexRangeTest, RefusesWhatIsNoRangeOrHasNoItem) {
  for (const std::string text :
       {"5", "a:b", "-1:3", "7:7", "7:3", "10:", "12:15", "1:2:3", "1.5:2"}) {
    const auto parsed = ParseIndexRange(text, 10);
    ASSERT_FALSE(parsed) << text;
    EXPECT_EQ(parsed.error().kind, ErrorKind::kInvalidInput);
    EXPECT_EQ(parsed.error().message,
              "the range is '" + text + "', must be 'A:B' with 0 <= A < B and A < 10");
  }
}

}  // namespace
}  // namespace relocd
