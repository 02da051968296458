#include "core/sha256.h"

#include <string>

#include <gtest/gtest.h>

namespace relocd {
namespace {

TEST(Sha256Test, GivesTheStandardsExamples) {  // FIPS 180-2, appendix B.1
  EXPECT_EQ(Sha256Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Sha256Hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Sha256Test, GoesThroughManyBytesInSteps) {
  int steps = 0;
  // As sha256sum says.
  EXPECT_EQ(Sha256Hex(std::string(2'500'000, 'a'), [&steps] { ++steps; }),
            "38a637965059125eeb67f54c30e7f48a61859a467a800ba09740ba48a924f2b9");
  EXPECT_EQ(steps, 3);
}

}  // namespace
}  // namespace relocd
