#include "report_plot.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "made_drive.h"
#include "plot_canvas.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

/// How many pixels have about this colour.
int CountOf(const cv::Mat& image, const cv::Scalar& colour) {
  const cv::Scalar tolerance(6, 6, 6);
  cv::Mat mask;
  cv::inRange(image, colour - tolerance, colour + tolerance, mask);
  return cv::countNonZero(mask);
}

TEST(ReportPlotTest, OutliersAreDrawnInAColourOfTheirOwn) {
  MadeDrive drive;
  const auto without = drive.Report();
  drive.camera = MadeDrive::kPoseHeader + MadeDrive::Pose(4, 1.5, 0.1, "ok");
  const auto with = drive.Report();
  ASSERT_TRUE(without);
  ASSERT_TRUE(with);
  const FigureStyle style;
  EXPECT_EQ(CountOf(DrawDrive(*without, {}, style), style.colours.outlier), 0);
  EXPECT_GT(CountOf(DrawDrive(*with, {}, style), style.colours.outlier), 50);
  EXPECT_EQ(CountOf(DrawErrors(*without, style), style.colours.outlier), 0);
  EXPECT_GT(CountOf(DrawErrors(*with, style), style.colours.outlier), 10);
}

TEST(ReportPlotTest, AnImageWithoutAPoseIsATickOverTheErrors) {
  MadeDrive drive;
  drive.camera = MadeDrive::kPoseHeader + MadeDrive::NoPose(4, "low_confidence");
  const auto report = drive.Report();
  ASSERT_TRUE(report);
  const FigureStyle style;
  EXPECT_GT(CountOf(DrawErrors(*report, style), style.colours.outlier), 10);
}

TEST(ReportPlotTest, ALongTitleStaysInsideTheFigure) {
  auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  report->title = std::string(200, 'M');
  const FigureStyle style;
  const cv::Mat figure = DrawDrive(*report, {}, style);
  const int margin = figure.cols / 50;
  EXPECT_EQ(CountOf(figure.colRange(figure.cols - margin, figure.cols), style.theme.ink), 0);
}

TEST(PlotCanvasTest, AnAxisHasAtLeastTwoNumbers) {
  const auto numbers = [](double half_size) {
    Canvas canvas(300.0, 200.0);
    Panel panel{.box = {80.0, 20.0, 200.0, 120.0}, .x = {0.0, 1.0}, .y = {-half_size, half_size}};
    DrawAxes(canvas, panel, "", "");
    // Rows of the strip left of the panel that have ink, in groups.
    const cv::Mat strip = canvas.Finish().colRange(0, 70).rowRange(0, 146);
    int groups = 0;
    bool was_ink = false;
    for (int row = 0; row < strip.rows; ++row) {
      const bool is_ink = cv::mean(strip.row(row))[0] < 254.0;
      if (is_ink && !was_ink) ++groups;
      was_ink = is_ink;
    }
    return groups;
  };
  for (double half_size = 0.3; half_size < 40.0; half_size *= 1.1)
    EXPECT_GE(numbers(half_size), 2) << half_size;
}

TEST(ReportPlotTest, TheDarkFiguresAreDark) {
  const auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  const FigureStyle dark = FigureStyle::Dark();
  for (const cv::Mat& figure : {DrawDrive(*report, {}, dark), DrawErrors(*report, dark)})
    EXPECT_LT(cv::mean(figure)[1], 80.0);
}

TEST(ReportPlotTest, ADriveOfOnePoseCanBeDrawn) {
  MadeDrive drive;
  drive.fused = MadeDrive::kPoseHeader + MadeDrive::Pose(4, 0.0, 0.1, "ok");
  const auto report = drive.Report();
  ASSERT_TRUE(report);
  EXPECT_FALSE(DrawDrive(*report, {}, {}).empty());
  EXPECT_FALSE(DrawErrors(*report, {}).empty());
}

TEST(ReportPlotTest, ThePictureOfTheGroundLiesUnderTheDrive) {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/top.png";
  const cv::Scalar blue(255, 0, 0);
  cv::imwrite(path, cv::Mat(20, 20, CV_8UC3, blue));
  const auto view = ReadTopView(path, {-100.0, -100.0, 100.0, 100.0});
  ASSERT_TRUE(view) << view.error().message;
  const auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  const double without = cv::mean(DrawDrive(*report, {}, {}))[2];
  EXPECT_LT(cv::mean(DrawDrive(*report, *view, {}))[2], without - 20.0);
}

TEST(ReportPlotTest, ATopViewThatIsNoneIsRefused) {
  const TemporaryFolder folder;
  const auto missing = ReadTopView(folder.path() + "/none.png", {0.0, 0.0, 1.0, 1.0});
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(missing.error().message, HasSubstr("none.png: cannot be read as a picture"));
  const std::string path = folder.path() + "/top.png";
  cv::imwrite(path, cv::Mat(2, 2, CV_8UC3, cv::Scalar()));
  const auto turned = ReadTopView(path, {1.0, 0.0, 0.0, 1.0});
  ASSERT_FALSE(turned);
  EXPECT_THAT(turned.error().message,
              HasSubstr("--top-view-extent is 1,0,0,1, must be left,bottom"));
}

}  // namespace
}  // namespace relocd
