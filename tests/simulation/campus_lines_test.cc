#include "simulation/campus_lines.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <Eigen/Core>
#include <gtest/gtest.h>

namespace relocd {
namespace {

TEST(CampusLinesTest, RoundedCornerKeepsItsRadius) {
  const std::array<RoundedCorner, 3> corners{
      {{{0.0, 0.0}, 0.0}, {{20.0, 0.0}, 8.0}, {{20.0, 20.0}, 0.0}}};
  const PlaneLine line = RoundedLine(corners);
  // Twice 12 m straight, and a quarter of a circle.
  EXPECT_NEAR(LineLength(line), 24.0 + 8.0 * 0.5 * std::numbers::pi, 0.02);
  for (const Eigen::Vector2d& p : line) {
    if (p.x() > 12.01 && p.y() < 7.99) {
      EXPECT_NEAR((p - Eigen::Vector2d(12.0, 8.0)).norm(), 8.0, 0.01);
    }
  }
}

TEST(CampusLinesTest, ResampledPointsAreEquallyFarApart) {
  const PlaneLine line = Resampled({{0.0, 0.0}, {3.3, 0.0}, {3.3, 10.0}}, 0.5, false);
  EXPECT_EQ(line.front(), Eigen::Vector2d(0.0, 0.0));
  EXPECT_NEAR((line.back() - Eigen::Vector2d(3.3, 10.0)).norm(), 0.0, 1e-9);
  for (std::size_t i = 0; i + 1 < line.size(); ++i)
    EXPECT_LE((line[i + 1] - line[i]).norm(), 0.52);
}

TEST(CampusLinesTest, OffsetToTheLeftIsLeft) {
  const PlaneLine line = OffsetLine({{0.0, 0.0}, {5.0, 0.0}, {10.0, 0.0}}, 2.0);
  for (const Eigen::Vector2d& p : line)
    EXPECT_NEAR(p.y(), 2.0, 1e-12);
}

TEST(CampusLinesTest, JoinedLinesLeaveTheFirstAndFollowTheSecond) {
  const auto joined = JoinedLines({{-20.0, 0.0}, {20.0, 0.0}}, {{0.0, 20.0}, {0.0, -30.0}}, 6.0);
  ASSERT_TRUE(joined.has_value());
  EXPECT_NEAR((joined->front() - Eigen::Vector2d(-20.0, 0.0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((joined->back() - Eigen::Vector2d(0.0, -30.0)).norm(), 0.0, 1e-9);
  // Straight up to 6 m before the crossing, a quarter turn to the right, straight on.
  EXPECT_NEAR(LineLength(*joined), 14.0 + 6.0 * 0.5 * std::numbers::pi + 24.0, 0.02);
}

TEST(CampusLinesTest, LinesThatDoNotCrossAreNotJoined) {
  EXPECT_FALSE(JoinedLines({{0.0, 0.0}, {10.0, 0.0}}, {{0.0, 1.0}, {10.0, 1.0}}, 3.0));
}

TEST(CampusLinesTest, PlacesAndDistancesAgree) {
  const PlaneLine line = Resampled({{0.0, 0.0}, {10.0, 0.0}, {10.0, 10.0}}, 0.5, false);
  for (const double s : {0.0, 3.2, 9.9, 13.7, 20.0})
    EXPECT_NEAR(NearestDistanceAlong(line, PlaceOnLine(line, s).p_W), s, 1e-9);
  EXPECT_NEAR(DistanceToLine(line, {5.0, -3.0}), 3.0, 1e-12);
  EXPECT_NEAR(LineLength(PartOfLine(line, 4.0, 13.0)), 9.0, 1e-9);
}

TEST(CampusLinesTest, SmoothingLeavesStraightLinesAndTheirEnds) {
  const PlaneLine line = Resampled({{0.0, 0.0}, {10.0, 5.0}}, 0.5, false);
  const PlaneLine smooth = SmoothedLine(line, 8, false);
  for (std::size_t i = 0; i < line.size(); ++i)
    EXPECT_NEAR((line[i] - smooth[i]).norm(), 0.0, 1e-9);
}

}  // namespace
}  // namespace relocd
