#include "map_report.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "support/html_page.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;
using testing::Not;

HeldOutFrame Frame(double along_m, std::optional<double> error_m) {
  HeldOutFrame frame;
  frame.name = fmt::format("{:04.0f}.jpg", along_m);
  frame.along_m = along_m;
  frame.p_W = {along_m, 0.0};
  frame.error_m = error_m;
  return frame;
}

/// A held-out frame every 4 m of 400 m, off by 0.2 m.
std::vector<HeldOutFrame> GoodRoute() {
  std::vector<HeldOutFrame> frames;
  for (int i = 0; i < 100; ++i)
    frames.push_back(Frame(4.0 * i, 0.2));
  return frames;
}

TEST(FindWeakStretchesTest, AGoodRouteHasNone) {
  EXPECT_TRUE(FindWeakStretches(GoodRoute()).empty());
  EXPECT_TRUE(FindWeakStretches({}).empty());
}

TEST(FindWeakStretchesTest, FindsAStretchWithItsDistancesAndFrames) {
  auto route = GoodRoute();
  for (std::size_t i = 20; i <= 24; ++i)
    route[i].error_m = 1.5 + 0.1 * static_cast<double>(i - 20);
  route[22].error_m = 3.0;
  const auto weak = FindWeakStretches(route);
  ASSERT_EQ(weak.size(), 1U);
  EXPECT_EQ(weak[0].begin_m, 80.0);
  EXPECT_EQ(weak[0].end_m, 96.0);
  EXPECT_EQ(weak[0].held_out, 5U);
  EXPECT_EQ(weak[0].lost, 0U);
  EXPECT_EQ(weak[0].worst_m, 3.0);
  EXPECT_EQ(weak[0].worst, 22U);
  EXPECT_EQ(weak[0].first_image, "0080.jpg");
  EXPECT_EQ(weak[0].last_image, "0096.jpg");
  EXPECT_EQ(DescribeWeakStretch(weak[0]),
            "drive metres 75 to 101 again (0080.jpg to 0096.jpg): of the held-out images there 5 "
            "off by up to 3.0 m");
}

TEST(FindWeakStretchesTest, AFrameThatIsNotFoundIsWorseThanOneThatIsFarOff) {
  auto route = GoodRoute();
  route[10].error_m = 80.0;
  route[60].error_m.reset();
  route[61].error_m = 2.0;
  const auto weak = FindWeakStretches(route);
  ASSERT_EQ(weak.size(), 2U);
  EXPECT_EQ(weak[0].begin_m, 240.0);
  EXPECT_EQ(weak[0].held_out, 2U);
  EXPECT_EQ(weak[0].lost, 1U);
  EXPECT_EQ(weak[0].worst, 60U);
  EXPECT_EQ(DescribeWeakStretch(weak[0]),
            "drive metres 235 to 249 again (0240.jpg to 0244.jpg): of the held-out images there 1 "
            "not found, 1 off by up to 2.0 m");
  EXPECT_EQ(weak[1].worst_m, 80.0);
  EXPECT_EQ(DescribeWeakStretch(weak[1]),
            "drive metres 35 to 45 again (0040.jpg): of the held-out images there 1 off by up to "
            "80.0 m");
}

TEST(FindWeakStretchesTest, JoinsWhatIsWithinTenMetresAndNothingFurther) {
  auto route = GoodRoute();
  for (const std::size_t i : {std::size_t{30}, std::size_t{32}, std::size_t{35}})
    route[i].error_m.reset();
  const auto weak = FindWeakStretches(route);  // at 120, 128 and 140 m
  ASSERT_EQ(weak.size(), 2U);
  EXPECT_EQ(weak[0].begin_m, 120.0);
  EXPECT_EQ(weak[0].end_m, 128.0);
  EXPECT_EQ(weak[0].held_out, 2U);
  EXPECT_EQ(weak[1].begin_m, 140.0);
}

/// What is usual on a coarse map is not weak there.
TEST(FindWeakStretchesTest, ComparesWithTheErrorsThatAreUsual) {
  auto route = GoodRoute();
  for (HeldOutFrame& frame : route)
    frame.error_m = 0.5;
  route[50].error_m = 2.4;
  EXPECT_TRUE(FindWeakStretches(route).empty());
  route[50].error_m = 2.6;  // more than five times the median
  EXPECT_EQ(FindWeakStretches(route).size(), 1U);
}

TEST(FindWeakStretchesTest, ARouteThatIsNotFoundAtAllIsOneStretch) {
  auto route = GoodRoute();
  for (HeldOutFrame& frame : route)
    frame.error_m.reset();
  const auto weak = FindWeakStretches(route);
  ASSERT_EQ(weak.size(), 1U);
  EXPECT_EQ(weak[0].lost, 100U);
  EXPECT_EQ(DescribeWeakStretch(weak[0]),
            "drive metres 0 to 401 again (0000.jpg to 0396.jpg): of the held-out images there 100 "
            "not found");
}

class TrainingReportTest : public testing::Test {
 protected:
  TrainingReportTest() {
    report_.datasets = "morning & <evening>";
    report_.how = "400 iterations of 512, seed 1, 60 s, threads: 1";
    report_.route_m = 396.0;
    report_.errors = {.frames = 100, .localized = 97, .median_m = 0.2, .p95_m = 1.25};
    report_.errors.median_rad = 0.01;
    report_.errors.within_1m = 0.95;
    report_.errors.within_95 = 0.9;
    report_.held_out = GoodRoute();
    for (const std::size_t i : {std::size_t{20}, std::size_t{21}, std::size_t{70}}) {
      report_.held_out[i].error_m.reset();
      report_.held_out[i].name = "a\"b<" + std::to_string(i) + ">.jpg";
      report_.held_out[i].image = folder_.Write(std::to_string(i), EncodedPicture(".jpg", 12));
    }
    for (const HeldOutFrame& frame : report_.held_out)
      report_.path.push_back(frame.p_W);
    report_.weak = FindWeakStretches(report_.held_out);
    RegionReport region;
    region.name = "<region>";
    region.end_m = 150.0;
    region.training_frames = 321;
    region.errors = report_.errors;
    region.live = {{.iteration = 200, .frames = 16, .localized = 12, .median_m = 0.75}};
    RegionReport second;
    second.name = "second";
    second.begin_m = 130.0;
    second.end_m = 396.0;
    report_.regions = {region, second};
  }

  TemporaryFolder folder_;
  TrainingReport report_;
};

TEST_F(TrainingReportTest, TheTextSaysHowGoodAndWhereToDriveAgain) {
  const std::string text = FormatTrainingReport(report_);
  EXPECT_THAT(text,
              HasSubstr("held-out training frames: 97 of 100 held-out images found: median 0.200 "
                        "m, 0.573 deg; p95 1.250 m; within 1 m 95.0 %; inside the reported 95 % "
                        "region 90 %\n"));
  EXPECT_THAT(text, HasSubstr("<region>: 0 to 150 m, 321 training frames; 97 of 100"));
  EXPECT_THAT(text, HasSubstr("<region>: after 200 iterations 12 of 16 found, median 0.75 m\n"));
  EXPECT_THAT(text,
              HasSubstr("second: 130 to 396 m, 0 training frames; 0 of 0 held-out images "
                        "found: none found; "));
  EXPECT_THAT(text, HasSubstr("weak: drive metres 75 to 89 again (a\"b<20>.jpg to a\"b<21>.jpg)"));
  EXPECT_THAT(text, Not(HasSubstr("nowhere")));
  report_.weak.clear();
  EXPECT_THAT(FormatTrainingReport(report_),
              HasSubstr("weak: nowhere; nothing needs to be driven again\n"));
}

TEST_F(TrainingReportTest, ThePageIsWellFormedAndHasItsSectionsAndPictures) {
  const auto html = FormatTrainingReportHtml(report_);
  ASSERT_TRUE(html);
  EXPECT_EQ(ProblemOf(*html), "");
  for (const char* section :
       {"The route from above", "Regions", "What to drive again", "How it was learned"})
    EXPECT_THAT(*html, HasSubstr(fmt::format("<h2>{}</h2>", section)));
  EXPECT_THAT(*html, HasSubstr("396 m in 2 regions. 97 of 100 held-out images are found"));
  // The route on a dark and on a light page, and an image for each of two stretches.
  EXPECT_THAT(WidthsOfPictures(*html), testing::ElementsAre(1350, 1350, 12, 12));
}

TEST_F(TrainingReportTest, ThePageEscapesNames) {
  const auto html = FormatTrainingReportHtml(report_);
  ASSERT_TRUE(html);
  EXPECT_THAT(*html, HasSubstr("<h1>Map of morning &amp; &lt;evening&gt;</h1>"));
  EXPECT_THAT(*html, HasSubstr("<td>&lt;region&gt;</td>"));
  EXPECT_THAT(*html, HasSubstr("alt=\"a&quot;b&lt;20&gt;.jpg\""));
  EXPECT_THAT(*html, Not(HasSubstr("<region>")));
  EXPECT_THAT(*html, Not(HasSubstr("<evening>")));
}

TEST_F(TrainingReportTest, ThePageNeedsNothingElse) {
  const auto html = FormatTrainingReportHtml(report_);
  ASSERT_TRUE(html);
  for (const char* const foreign : {"http", "<script", "<link", "href=", "url(", "@import"})
    EXPECT_THAT(*html, Not(HasSubstr(foreign)));
}

/// A median of nothing is not 0.000 m.
TEST_F(TrainingReportTest, WhereNothingIsFoundThePageHasNoErrors) {
  report_.errors = {.frames = 40};
  const auto html = FormatTrainingReportHtml(report_);
  ASSERT_TRUE(html);
  EXPECT_EQ(ProblemOf(*html), "");
  EXPECT_THAT(*html, HasSubstr("None of 40 held-out images is found."));
  EXPECT_THAT(*html, HasSubstr("<td>0 of 0</td><td>–</td>"));
  EXPECT_THAT(*html, Not(HasSubstr("0.000")));
}

TEST_F(TrainingReportTest, WithoutWeakStretchesThePageSaysSo) {
  report_.weak.clear();
  report_.regions.front().live.clear();
  const auto html = FormatTrainingReportHtml(report_);
  ASSERT_TRUE(html);
  EXPECT_EQ(ProblemOf(*html), "");
  EXPECT_THAT(*html, HasSubstr("Nothing: no held-out image is lost or far off."));
  EXPECT_THAT(*html, Not(HasSubstr("How it was learned")));
}

TEST_F(TrainingReportTest, AnImageThatIsGoneIsNamed) {
  report_.held_out[20].image = folder_.path() + "/gone.jpg";
  const auto html = FormatTrainingReportHtml(report_);
  ASSERT_FALSE(html);
  EXPECT_THAT(html.error().message, HasSubstr("gone.jpg"));
}

/// The same scale along both axes, and no more room than the route takes.
TEST_F(TrainingReportTest, ThePlotIsAsHighAsTheRoute) {
  const auto height = [this](double y_m) {
    report_.path = {{0.0, 0.0}, {100.0, y_m}};
    const std::string png = PlotTrainingReport(report_, false);
    const std::vector<unsigned char> bytes(png.begin(), png.end());
    return cv::imdecode(bytes, cv::IMREAD_COLOR).rows;
  };
  EXPECT_EQ(height(0.0), 405);   // a panel of 200
  EXPECT_EQ(height(48.0), 720);  // half as high as wide: 410
  EXPECT_EQ(height(500.0), 960);
}

/// Of frames that are not found, the plot has dots of another colour.
TEST_F(TrainingReportTest, ThePlotShowsWhatIsLost) {
  const auto lost_pixels = [](const TrainingReport& report) {
    const std::string png = PlotTrainingReport(report, false);
    const std::vector<unsigned char> bytes(png.begin(), png.end());
    const cv::Mat plot = cv::imdecode(bytes, cv::IMREAD_COLOR);
    return std::count(plot.begin<cv::Vec3b>(), plot.end<cv::Vec3b>(), cv::Vec3b(96, 24, 190));
  };
  EXPECT_GT(lost_pixels(report_), 100);
  report_.held_out = GoodRoute();
  EXPECT_EQ(lost_pixels(report_), 0);
}

}  // namespace
}  // namespace relocd
