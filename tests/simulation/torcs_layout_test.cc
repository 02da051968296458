#include "simulation/torcs_layout.h"

#include <cmath>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulation/torcs_test_track.h"
#include "support/mutate_bytes.h"
#include "support/random.h"

namespace relocd {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr double kPi = std::numbers::pi;

std::string Number(const std::string& name, double value, const std::string& unit = "") {
  return fmt::format("<attnum name=\"{}\" val=\"{}\" unit=\"{}\"/>", name, value, unit);
}

std::string Segment(const std::string& type, const std::string& numbers) {
  return fmt::format(
      "<section name=\"s\"><attstr name=\"type\" val=\"{}\"/>{}</section>\n", type, numbers);
}

std::string File(const std::string& segments, const std::string& numbers = Number("width", 8)) {
  return "<params>\n<section name=\"Graphic\"><attstr name=\"3d description\" val=\"a.ac\"/>"
         "</section>\n<section name=\"Main Track\">" +
         numbers + "<section name=\"Track Segments\">\n" + segments +
         "</section></section></params>";
}

/// Two half circles to the left.
std::string Circle(double radius, const std::string& numbers = "") {
  const std::string half =
      Segment("lft", Number("radius", radius) + Number("arc", 180, "deg") + numbers);
  return half + half;
}

std::string ParseError(const std::string& xml) {
  const auto layout = ParseTorcsLayout(xml, "a.xml");
  return layout ? "" : layout.error().message;
}

TEST(ParseTorcsLayout, GoesRoundACircle) {
  const auto layout = ParseTorcsLayout(File(Circle(50.0)), "a.xml");
  ASSERT_TRUE(layout) << layout.error().message;
  EXPECT_EQ(layout->mesh_file, "a.ac");
  EXPECT_EQ(layout->width_m, 8.0);
  EXPECT_NEAR(layout->length_m(), 100.0 * kPi, 1e-9);
  double before = -1.0;
  for (const TorcsStation& station : layout->stations) {
    EXPECT_NEAR((station.p_T - Eigen::Vector2d(0.0, 50.0)).norm(), 50.0, 1e-9);
    EXPECT_NEAR(station.yaw_T_rad, station.s_m / 50.0, 1e-9);
    EXPECT_LE(station.s_m - before, 1.0 + 1e-9);
    before = station.s_m;
  }
}

TEST(ParseTorcsLayout, TurnsRightAndLeft) {
  // Quarter circles to the left and three quarters to the right, twice.
  const std::string left = Number("radius", 20) + Number("arc", 90, "deg");
  const std::string three = Number("radius", 20) + Number("arc", 270, "deg");
  const auto layout = ParseTorcsLayout(File(Segment("lft", left) + Segment("rgt", three) +
                                            Segment("lft", left) + Segment("rgt", three)),
                                       "a.xml");
  ASSERT_TRUE(layout) << layout.error().message;
  double left_most = 0.0;
  for (const TorcsStation& station : layout->stations) {
    left_most = std::max(left_most, station.p_T.y());
  }
  EXPECT_NEAR(left_most, 40.0, 0.1);
  EXPECT_NEAR(layout->stations.back().yaw_T_rad, -2.0 * kPi, 1e-9);
}

TEST(ParseTorcsLayout, SpiralsTurnByTheirArcWithARadiusThatGoesEvenly) {
  const std::string spiral = Number("radius", 40) + Number("end radius", 80) +
                             Number("arc", 90, "deg") + Number("profil steps", 10);
  const std::string back = Number("radius", 80) + Number("end radius", 40) +
                           Number("arc", 90, "deg") + Number("profil steps", 10);
  const auto layout = ParseTorcsLayout(File(Segment("lft", spiral) + Segment("lft", back) +
                                            Segment("lft", spiral) + Segment("lft", back)),
                                       "a.xml");
  ASSERT_TRUE(layout) << layout.error().message;
  std::vector<TorcsStation> steps;
  for (const TorcsStation& station : layout->stations) {
    if (station.is_mesh_boundary) steps.push_back(station);
  }
  ASSERT_EQ(steps.size(), 41U);
  EXPECT_NEAR(steps[10].yaw_T_rad, 0.5 * kPi, 1e-9);
  const double step = steps[1].s_m;
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_NEAR(steps[i + 1].s_m - steps[i].s_m, step, 1e-9);
    EXPECT_NEAR(step / (steps[i + 1].yaw_T_rad - steps[i].yaw_T_rad),
                40.0 + 40.0 * static_cast<double>(i) / 9.0,
                1e-6);
  }
}

TEST(ParseTorcsLayout, TakesUnitsAndDefaults) {
  const std::string half = Segment("lft", Number("radius", 100, "ft") + Number("arc", kPi));
  const auto layout = ParseTorcsLayout(File(half + half, ""), "a.xml");
  ASSERT_TRUE(layout) << layout.error().message;
  EXPECT_EQ(layout->width_m, 15.0);
  EXPECT_NEAR(layout->length_m(), 2.0 * kPi * 30.48, 1e-6);
}

TEST(ParseTorcsLayout, ClimbsAlongASplineAndBanks) {
  const std::string turn =
      Number("radius", 50) + Number("arc", 180, "deg") + Number("profil steps", 50);
  const auto layout = ParseTorcsLayout(
      File(Segment("lft", turn + Number("z end", 6) + Number("banking end", 10, "deg")) +
           Segment("lft",
                   turn + Number("grade", -2, "%") + Number("profil start tangent", 5, "%") +
                       Number("profil end tangent", -3, "%"))),
      "a.xml");
  ASSERT_TRUE(layout) << layout.error().message;
  const double length = 50.0 * kPi;
  const double bank = std::tan(10.0 * kPi / 180.0) * 8.0;
  const double end_z = 6.0 - 0.02 * length;
  for (const TorcsStation& station : layout->stations) {
    if (!station.is_mesh_boundary) continue;
    const double z = 0.5 * (station.left_z_T + station.right_z_T);
    const double tilt = station.left_z_T - station.right_z_T;
    if (station.s_m <= length) {
      const double t = station.s_m / length;
      const double smooth = t * t * (3.0 - 2.0 * t);
      EXPECT_NEAR(z, 6.0 * smooth, 1e-9);
      EXPECT_NEAR(tilt, bank * smooth, 1e-9);
    } else {
      // A cubic with these ends and slopes, by its Bezier points.
      const double t = station.s_m / length - 1.0;
      const double a = 6.0 + 0.05 * length / 3.0;
      const double b = end_z + 0.03 * length / 3.0;
      const double u = 1.0 - t;
      EXPECT_NEAR(
          z, u * u * u * 6.0 + 3 * u * u * t * a + 3 * u * t * t * b + t * t * t * end_z, 1e-9);
      EXPECT_NEAR(tilt, bank, 1e-9);
    }
  }
}

TEST(ParseTorcsLayout, SpreadsASmallGapOverTheLoop) {
  const std::string half = Number("radius", 50) + Number("arc", 180, "deg");
  const auto layout =
      ParseTorcsLayout(File(Segment("str", Number("lg", 100)) + Segment("lft", half) +
                            Segment("str", Number("lg", 100.4)) + Segment("lft", half)),
                       "a.xml");
  ASSERT_TRUE(layout) << layout.error().message;
  EXPECT_LT((layout->stations.back().p_T - layout->stations.front().p_T).norm(), 1e-9);
  // A quarter of the way has a quarter of the gap.
  EXPECT_NEAR(layout->stations[100].p_T.x(), 100.0 + 0.4 * 100.0 / layout->length_m(), 1e-9);
}

TEST(ParseTorcsLayout, ReadsATrackWithEntitiesWithoutFollowingThem) {
  const auto layout = ParseTorcsLayout(TorcsTestTrack::Layout(), "a.xml");
  ASSERT_TRUE(layout) << layout.error().message;
  EXPECT_NEAR(layout->length_m(), TorcsTestTrack::Length(), 1e-9);
}

TEST(ParseTorcsLayout, SaysWhereItIsDamaged) {
  EXPECT_EQ(ParseError("<params>\n<section>\n</params>"), "a.xml: line 3: Start-end tags mismatch");
  EXPECT_EQ(ParseError(""), "a.xml: line 1: No document element found");
  EXPECT_EQ(ParseError("<other/>"), "a.xml: has no element 'params' at its top");
  EXPECT_EQ(ParseError("<params/>"), "a.xml: has no section 'Graphic'");
  EXPECT_EQ(ParseError(File(Segment("jump", ""))),
            "a.xml: Main Track: Track Segments: 's': type is 'jump', must be str, lft or rgt");
  EXPECT_EQ(ParseError(File(Segment("str", ""))),
            "a.xml: Main Track: Track Segments: 's': has no number 'lg'");
  EXPECT_EQ(ParseError(File(Segment("str", Number("lg", -5, "m")))),
            "a.xml: Main Track: Track Segments: 's': 'lg' is '-5 m', must be in [0.001, 200000] in "
            "SI units");
  EXPECT_EQ(ParseError(File(Segment("str", Number("lg", 5, "mile")))),
            "a.xml: Main Track: Track Segments: 's': unit of 'lg' is 'mile', must be m, km, cm, "
            "mm, ft, in, rad, deg or %");
  EXPECT_EQ(ParseError(File(Circle(3.0))),
            "a.xml: Main Track: Track Segments: 's': radius is 3, must be at least half the width "
            "8");
  EXPECT_THAT(ParseError(File(Circle(50.0), Number("width", 0.5))),
              HasSubstr("'width' is '0.5 ', must be in [2, 100] in SI units"));
  EXPECT_THAT(ParseError(File(Segment("str", Number("lg", 150, "km")) +
                              Segment("str", Number("lg", 150, "km")))),
              HasSubstr("the track gets longer than 200000 m"));
  EXPECT_THAT(ParseError(File(Segment("str", Number("lg", 100)))),
              StartsWith("a.xml: the track ends 100.00 m and 0.000 rad from its beginning after "
                         "100 m, must be within 1 m"));
  EXPECT_THAT(ParseError(File("")), HasSubstr("after 0 m"));
}

TEST(ParseTorcsLayout, NamesTheFileWhereverItIsCutShort) {
  const std::string xml = TorcsTestTrack::Layout();
  for (std::size_t size = 0; size + 1 < xml.size(); ++size) {
    EXPECT_THAT(ParseError(xml.substr(0, size)), StartsWith("a.xml: line ")) << size;
  }
}

TEST(ParseTorcsLayout, SurvivesAnyBytes) {
  TestRandom random(1);
  const std::string xml = TorcsTestTrack::Layout();
  for (int trial = 0; trial < 5000; ++trial) {
    const auto layout = ParseTorcsLayout(MutateBytes(xml, random), "a.xml");
    if (!layout) continue;
    for (const TorcsStation& station : layout->stations) {
      ASSERT_TRUE(station.p_T.allFinite());
      ASSERT_TRUE(std::isfinite(station.left_z_T + station.right_z_T));
    }
  }
}

}  // namespace
}  // namespace relocd
