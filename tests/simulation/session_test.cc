#include "simulation/session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using testing::HasSubstr;

TEST(SessionTest, EveryWordIsASessionByItselfAndHasADescription) {
  for (const SessionTrait& trait : SessionTraits()) {
    const auto session = ParseSession(trait.name);
    ASSERT_TRUE(session) << trait.name;
    EXPECT_EQ(session->name, trait.name);
    EXPECT_FALSE(trait.description.empty()) << trait.name;
  }
}

TEST(SessionTest, WordsAddUp) {
  const Session session = ParseSession("evening+wet+traffic+left").value();
  EXPECT_GT(session.sun_strength, 0.0);
  EXPECT_LT(session.sun_elevation_rad, 0.3);
  EXPECT_EQ(session.wetness, 1.0);
  EXPECT_GT(session.cars_per_km, 0.0);
  EXPECT_EQ(session.lateral_offset_m, 1.0);
}

TEST(SessionTest, RainAtDuskIsAsDarkAsDusk) {
  const double dusk = ParseSession("dusk").value().sky_brightness;
  EXPECT_EQ(ParseSession("dusk+rain").value().sky_brightness, dusk);
  EXPECT_EQ(ParseSession("rain+dusk").value().sky_brightness, dusk);
  EXPECT_TRUE(ParseSession("rain+dusk").value().lamps_on);
}

TEST(SessionTest, ReparkedMeansOtherCars) {
  EXPECT_NE(ParseSession("noon").value().parked_seed,
            ParseSession("noon+reparked").value().parked_seed);
}

TEST(SessionTest, AnUnknownWordIsNamedWithTheNearestOne) {
  const auto refused = ParseSession("noon+evning");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(refused.error().message,
              HasSubstr("session 'noon+evning': unknown word 'evning', did you mean 'evening'?"));
  EXPECT_THAT(refused.error().message, HasSubstr("overcast"));
  EXPECT_FALSE(ParseSession(""));
  EXPECT_FALSE(ParseSession("noon+"));
}

}  // namespace
}  // namespace relocd
