#include "report_html.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "made_drive.h"
#include "support/html_page.h"

namespace relocd {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string MakePage(const DriveReport& report) {
  ReportFrame alone;
  alone.time_s = 1.5;
  alone.jpeg = EncodedPicture(".jpg", 10);
  alone.camera_status = "low_confidence";
  alone.confidence = 0.25;
  ReportFrame pair = alone;
  pair.teach_jpeg = EncodedPicture(".jpg", 12);
  pair.camera_error_m = 3.0;
  pair.fused_error_m = 0.25;
  return FormatReportHtml(report,
                          {"image/png", EncodedPicture(".png", 14), EncodedPicture(".png", 16)},
                          {"image/jpeg", EncodedPicture(".jpg", 18), EncodedPicture(".jpg", 20)},
                          {alone, pair});
}

TEST(ReportHtmlTest, EncodesTheExamplesOfRfc4648) {
  EXPECT_EQ(EncodeBase64(""), "");
  EXPECT_EQ(EncodeBase64("f"), "Zg==");
  EXPECT_EQ(EncodeBase64("fo"), "Zm8=");
  EXPECT_EQ(EncodeBase64("foo"), "Zm9v");
  EXPECT_EQ(EncodeBase64("foob"), "Zm9vYg==");
  EXPECT_EQ(EncodeBase64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(EncodeBase64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(EncodeBase64("\xff\xfe\xfd"), "//79");
}

TEST(ReportHtmlTest, TheCheckFindsWhatIsNotWellFormed) {
  EXPECT_EQ(ProblemOf("<p>a<br>b</p>"), "");
  EXPECT_NE(ProblemOf("<p><b>a</p></b>"), "");
  EXPECT_NE(ProblemOf("<p>a"), "");
  EXPECT_NE(ProblemOf("<p class=\"a>b</p>"), "");
}

TEST(ReportHtmlTest, IsWellFormedAndHoldsItsPictures) {
  auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  const std::string html = MakePage(*report);
  EXPECT_EQ(ProblemOf(html), "");
  EXPECT_THAT(WidthsOfPictures(html), testing::UnorderedElementsAre(14, 16, 18, 20, 10, 10, 12));
}

TEST(ReportHtmlTest, NeedsNothingElse) {
  const auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  const std::string html = MakePage(*report);
  for (const char* const foreign : {"http", "<script", "<link", "href=", "url(", "@import"})
    EXPECT_THAT(html, Not(HasSubstr(foreign)));
  EXPECT_THAT(html, HasSubstr("prefers-color-scheme:dark"));
  EXPECT_THAT(html, HasSubstr("name=\"viewport\""));
}

TEST(ReportHtmlTest, EscapesWhatItIsGiven) {
  auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  report->title = "<b>rain & \"dusk\"";
  report->images_without_pose["<i>"] = 1;
  const std::string html = MakePage(*report);
  EXPECT_EQ(ProblemOf(html), "");
  EXPECT_THAT(html, HasSubstr("<h1>&lt;b&gt;rain &amp; &quot;dusk&quot;</h1>"));
}

TEST(ReportHtmlTest, SaysItOfACameraWithoutAPoseAndOfAPoseWithoutAStatus) {
  MadeDrive drive;
  drive.camera = MadeDrive::kPoseHeader + MadeDrive::NoPose(1, "low_confidence");
  drive.fused = "time_ns,x_m,y_m,heading_rad\n0,5,2,1.5\n1000000000,5,3,1.5\n";
  auto report = drive.Report();
  ASSERT_TRUE(report);
  const std::string html = MakePage(*report);
  EXPECT_EQ(ProblemOf(html), "");
  EXPECT_THAT(html, HasSubstr("no pose to compare"));
  EXPECT_THAT(html, HasSubstr("no covariance is reported"));
  EXPECT_THAT(html, Not(HasSubstr("Status of the pose")));
}

}  // namespace
}  // namespace relocd
