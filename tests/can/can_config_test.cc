#include "can/can_config.h"

#include <cmath>

#include <gtest/gtest.h>

namespace relocd {
namespace {

std::string ErrorOf(const CanConfig& config) {
  const auto valid = config.Validate();
  return valid ? "" : valid.error().message;
}

TEST(CanConfigTest, AcceptsItsDefaults) {
  EXPECT_EQ(ErrorOf({}), "");
}

TEST(CanConfigTest, NamesFieldValueAndWhatIsAllowed) {
  EXPECT_EQ(ErrorOf({.source = "can"}),
            "source is 'can', must be one of socketcan, candump, unix, fd");
  EXPECT_EQ(ErrorOf({.interface = "can.0"}),
            "interface is 'can.0', must be of letters, digits and _");
  EXPECT_EQ(ErrorOf({.source = "candump"}), "path is empty, must name a file with source candump");
  EXPECT_EQ(ErrorOf({.source = "fd"}), "fd is -1, must be at least 0 with source fd");
  EXPECT_EQ(ErrorOf({.playback_start_s = -1.0}),
            "playback_start_s is -1, must be finite and at least 0");
  EXPECT_EQ(ErrorOf({.playback_start_s = std::nan("")}),
            "playback_start_s is nan, must be finite and at least 0");
}

}  // namespace
}  // namespace relocd
