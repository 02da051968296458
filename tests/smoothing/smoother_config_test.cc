#include "smoothing/smoother_config.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using ::testing::HasSubstr;

TEST(SmootherConfigTest, DefaultsAreValid) {
  EXPECT_TRUE(SmootherConfig().Validate());
}

TEST(SmootherConfigTest, NamesFieldValueAndWhatIsAllowed) {
  SmootherConfig config;
  config.keyframe_distance_m = -1.0;
  const auto result = config.Validate();
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(result.error().message, "keyframe_distance_m is -1, must be > 0 and finite");
}

TEST(SmootherConfigTest, NamesTheLimitsOfARange) {
  SmootherConfig config;
  config.window_keyframes = 1;
  EXPECT_EQ(config.Validate().error().message, "window_keyframes is 1, must be in [2, 5000]");
}

TEST(SmootherConfigTest, RefusesNan) {
  SmootherConfig config;
  config.default_odometry_noise.position_sigma_m_per_sqrt_s =
      std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(config.Validate().error().message,
              HasSubstr("default_odometry_noise.position_sigma_m_per_sqrt_s is nan"));
}

TEST(SmootherConfigTest, VisitsEveryField) {
  SmootherConfig config;
  int fields = 0;
  SmootherConfig::VisitFields(config, [&](const char*, auto&, const char* comment) {
    EXPECT_STRNE(comment, "");
    ++fields;
  });
  EXPECT_EQ(fields, 33);
}

}  // namespace
}  // namespace relocd
