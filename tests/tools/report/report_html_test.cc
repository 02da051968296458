#include "report_html.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "made_drive.h"

namespace relocd {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string EncodedPicture(const char* type, int width) {
  std::vector<unsigned char> bytes;
  cv::imencode(type, cv::Mat(4, width, CV_8UC3, cv::Scalar(10, 200, 30)), bytes);
  return {bytes.begin(), bytes.end()};
}

bool IsVoid(std::string_view name) {
  for (const std::string_view other : {"!DOCTYPE", "meta", "img", "source", "br"}) {
    if (name == other) return true;
  }
  return false;
}

/// @return what is wrong with the nesting of the page's elements; empty when it is well-formed.
std::string ProblemOf(std::string_view html) {
  std::vector<std::string> open;
  std::size_t at = 0;
  while ((at = html.find('<', at)) != std::string_view::npos) {
    const std::size_t end = html.find('>', at);
    if (end == std::string_view::npos) return "a tag does not end";
    const std::string_view tag = html.substr(at + 1, end - at - 1);
    if (tag.find('<') != std::string_view::npos) return "a tag within a tag: " + std::string(tag);
    if (std::ranges::count(tag, '"') % 2 != 0) return "an open quote: " + std::string(tag);
    const bool is_end = tag.starts_with('/');
    const std::string name(tag.substr(is_end ? 1 : 0, tag.find(' ') - (is_end ? 1 : 0)));
    if (is_end) {
      if (open.empty() || open.back() != name) return "</" + name + "> ends nothing";
      open.pop_back();
    } else if (!IsVoid(name)) {
      open.push_back(name);
    }
    at = end;
    if (name == "style" && !is_end) at = html.find("</style>", end);
  }
  return open.empty() ? "" : "<" + open.back() + "> does not end";
}

std::vector<unsigned char> DecodeBase64(std::string_view text) {
  std::vector<unsigned char> bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const auto digit =
        std::string_view("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/")
            .find(c);
    if (digit == std::string_view::npos) break;
    bits = bits << 6U | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<unsigned char>(bits >> static_cast<unsigned>(count) & 0xFFU));
  }
  return bytes;
}

/// The widths of all pictures in the page, 0 for one that cannot be decoded.
std::vector<int> WidthsOfPictures(std::string_view html) {
  constexpr std::string_view kBase64 = ";base64,";
  std::vector<int> widths;
  std::size_t at = 0;
  while ((at = html.find(kBase64, at)) != std::string_view::npos) {
    at += kBase64.size();
    const auto bytes = DecodeBase64(html.substr(at, html.find('"', at) - at));
    widths.push_back(bytes.empty() ? 0 : cv::imdecode(bytes, cv::IMREAD_COLOR).cols);
  }
  return widths;
}

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
