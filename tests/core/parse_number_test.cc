#include "core/parse_number.h"

#include <gtest/gtest.h>

namespace relocd {
namespace {

TEST(ParseNumberTest, TakesTheWholeTextOrNothing) {
  EXPECT_EQ(ParseDouble(" 1.5\t"), 1.5);
  EXPECT_EQ(ParseDouble("+2e3"), 2000.0);
  EXPECT_EQ(ParseDouble("-0.25"), -0.25);
  for (const char* text : {"", " ", "1.5x", "1,5", "0x10", "--1", "1 2", "+"}) {
    EXPECT_FALSE(ParseDouble(text).has_value()) << "'" << text << "'";
  }
}

TEST(ParseNumberTest, RefusesAnIntegerThatOverflows) {
  EXPECT_EQ(ParseInt64("9223372036854775807"), INT64_MAX);
  EXPECT_FALSE(ParseInt64("9223372036854775808").has_value());
  EXPECT_FALSE(ParseInt64("1.0").has_value());
}

TEST(ParseNumberTest, TrimsBothEnds) {
  EXPECT_EQ(Trim(" \ta b\r\n"), "a b");
  EXPECT_EQ(Trim("  "), "");
}

}  // namespace
}  // namespace relocd
