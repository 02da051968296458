#include "core/nearest_name.h"

#include <gtest/gtest.h>

namespace relocd {
namespace {

TEST(NearestNameTest, FindsWhatWasMeant) {
  const std::vector<std::string> names{"wheel_radius_m", "track_width_m", "interface"};
  EXPECT_EQ(NearestName("wheel_radius", names), "wheel_radius_m");
  EXPECT_EQ(NearestName("tarck_width_m", names), "track_width_m");
  EXPECT_EQ(NearestName("intreface", names), "interface");
  EXPECT_EQ(NearestName("zzzzzz", names), "");
  EXPECT_EQ(NearestName(std::string(10000, 'x'), names), "");
}

}  // namespace
}  // namespace relocd
