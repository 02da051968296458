#include "core/result.h"

#include <memory>
#include <string>

#include <gtest/gtest.h>

namespace relocd {
namespace {

Result<int> Half(int number) {
  if (number % 2 != 0) return Error{ErrorKind::kInvalidInput, "odd"};
  return number / 2;
}

TEST(ResultTest, HoldsAValueOrAnError) {
  EXPECT_EQ(*Half(4), 2);
  EXPECT_FALSE(Half(3));
  EXPECT_EQ(Half(3).error().kind, ErrorKind::kInvalidInput);
}

TEST(ResultTest, MovesItsValueOut) {
  Result<std::unique_ptr<int>> result(std::make_unique<int>(7));
  const std::unique_ptr<int> value = std::move(result).value();
  EXPECT_EQ(*value, 7);
}

TEST(ResultTest, ContextReadsFromTheOutsideIn) {
  EXPECT_EQ(Half(3).error().message, "odd");
  EXPECT_EQ(Half(3).error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(Error(Half(3).error()).WithContext("halving").message, "halving: odd");
}

TEST(ResultDeathTest, UsingTheMissingSideIsABug) {
  EXPECT_DEATH(static_cast<void>(Half(3).value()), "value\\(\\) of a failed Result");
  EXPECT_DEATH(static_cast<void>(Half(4).error()), "error\\(\\) of a successful Result");
}

}  // namespace
}  // namespace relocd
