#include "report_numbers.h"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "made_drive.h"

namespace relocd {
namespace {

using testing::DoubleNear;
using testing::HasSubstr;
using testing::Pair;
using testing::UnorderedElementsAre;

constexpr double kTolerance = 1e-9;

TEST(ReportNumbersTest, OdometryStartsAtTheTrueFirstPose) {
  const auto report = MadeDrive().Report();
  ASSERT_TRUE(report) << report.error().message;
  // Off by 0.09 m more each second.
  EXPECT_NEAR(report->odometry.position_m.mean, 0.45, kTolerance);
  EXPECT_NEAR(report->odometry.position_m.max, 0.9, kTolerance);
  EXPECT_NEAR(report->odometry.heading_deg.max, 0.0, 1e-6);
  EXPECT_EQ(report->odometry.position_m.count, 11U);
}

TEST(ReportNumbersTest, AlignedOdometryIsLaidOverTheTruth) {
  const auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  // Off by 0.09 m a second, both ways from the middle.
  EXPECT_NEAR(report->odometry_aligned.position_m.max, 0.45, kTolerance);
  EXPECT_NEAR(report->odometry_aligned.position_m.mean, 0.09 * 30.0 / 11.0, kTolerance);
}

TEST(ReportNumbersTest, TheFusedPosesErrorsAreThoseThatWereMade) {
  MadeDrive drive;
  drive.fused = MadeDrive::kPoseHeader;
  for (int k = 0; k < MadeDrive::kRows; ++k)
    drive.fused += MadeDrive::Pose(k, 0.1 * k, 0.5, "ok");
  const auto report = drive.Report();
  ASSERT_TRUE(report);
  EXPECT_NEAR(report->fused.position_m.mean, 0.5, kTolerance);
  EXPECT_NEAR(report->fused.position_m.median, 0.5, kTolerance);
  EXPECT_NEAR(report->fused.position_m.rmse, std::sqrt(0.35), kTolerance);
  EXPECT_NEAR(report->fused.position_m.max, 1.0, kTolerance);
  EXPECT_NEAR(report->length_m, 10.0, kTolerance);
  EXPECT_NEAR(report->duration_s, 10.0, kTolerance);
}

TEST(ReportNumbersTest, TheDriveIsAllOfItAlsoWhereThereWasNoFusedPoseYet) {
  MadeDrive drive;
  drive.fused = MadeDrive::kPoseHeader + MadeDrive::NoPose(0, "uninitialised") +
                MadeDrive::Pose(8, 0.1, 0.1, "ok") + MadeDrive::Pose(9, 0.1, 0.1, "ok");
  const auto report = drive.Report();
  ASSERT_TRUE(report);
  EXPECT_NEAR(report->length_m, 10.0, kTolerance);
  EXPECT_NEAR(report->duration_s, 10.0, kTolerance);
  EXPECT_EQ(report->truths.size(), 11U);
}

TEST(ReportNumbersTest, OutliersAreCountedAndStayInTheNumbers) {
  MadeDrive drive;
  drive.camera = MadeDrive::kPoseHeader;
  for (int k = 0; k < MadeDrive::kRows; ++k)
    drive.camera += MadeDrive::Pose(k, k == 3 ? 20.0 : k == 4 ? 1.01 : 0.99, 0.1, "ok");
  const auto report = drive.Report();
  ASSERT_TRUE(report);
  EXPECT_EQ(report->camera.outliers, 2U);
  EXPECT_NEAR(report->camera.position_m.max, 20.0, kTolerance);
  EXPECT_NEAR(report->camera.position_m.median, 0.99, kTolerance);
  EXPECT_THAT(FormatReportText(*report), HasSubstr("2 poses are off by more than 1 m"));
}

TEST(ReportNumbersTest, CoverageCountsWhatIsInsideTheReportedRegions) {
  MadeDrive drive;
  drive.fused = MadeDrive::kPoseHeader;
  // The 95 % region of sigma 0.1 reaches to 0.2448 in (x, y), and to 0.2795 with the heading.
  for (int k = 0; k < MadeDrive::kRows; ++k)
    drive.fused += MadeDrive::Pose(k, k < 5 ? 0.24 : k < 8 ? 0.27 : 0.3, 0.1, "ok");
  const auto report = drive.Report();
  ASSERT_TRUE(report);
  const Coverage& coverage = report->fused.evaluation->coverage;
  EXPECT_NEAR(coverage.position_share, 5.0 / 11.0, kTolerance);
  EXPECT_NEAR(coverage.pose_share, 8.0 / 11.0, kTolerance);
  EXPECT_THAT(FormatReportText(*report), HasSubstr("45.5 %"));
}

TEST(ReportNumbersTest, ImagesWithoutAPoseAreCountedByReason) {
  MadeDrive drive;
  drive.camera = MadeDrive::kPoseHeader + MadeDrive::Pose(0, 0.1, 0.1, "ok") +
                 MadeDrive::NoPose(1, "low_confidence") + MadeDrive::NoPose(2, "bad_image") +
                 MadeDrive::NoPose(3, "low_confidence");
  const auto report = drive.Report();
  ASSERT_TRUE(report);
  EXPECT_THAT(report->images_without_pose,
              UnorderedElementsAre(Pair("low_confidence", 2), Pair("bad_image", 1)));
  EXPECT_THAT(DescribeImages(*report),
              HasSubstr("4 worked on: 1 gave a pose, 3 none (1 bad_image, 2 low_confidence)"));
}

TEST(ReportNumbersTest, ACameraThatGaveNoPoseAtAllIsARowAndNotAnError) {
  MadeDrive drive;
  drive.camera = MadeDrive::kPoseHeader + MadeDrive::NoPose(1, "low_confidence") +
                 MadeDrive::NoPose(2, "low_confidence");
  const auto report = drive.Report();
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_FALSE(report->camera.evaluation);
  EXPECT_THAT(FormatReportText(*report), HasSubstr("no pose to compare"));
  EXPECT_THAT(FormatReportJson(*report), HasSubstr("\"camera\":{\"poses\":0,"));
}

TEST(ReportNumbersTest, SharesOfTheStatusesAreOfTheTime) {
  MadeDrive drive;
  drive.fused = MadeDrive::kPoseHeader + MadeDrive::NoPose(0, "uninitialised") +
                MadeDrive::Pose(1, 0.1, 0.1, "ok") + MadeDrive::Pose(2, 0.1, 0.1, "ok") +
                MadeDrive::Pose(3, 0.1, 0.1, "dead_reckoning") +
                MadeDrive::Pose(4, 0.1, 0.1, "ok") + MadeDrive::Pose(10, 0.1, 0.1, "ok") +
                MadeDrive::Pose(20, 0.1, 0.1, "lost");
  const auto report = drive.Report();
  ASSERT_TRUE(report);
  EXPECT_THAT(report->status_shares,
              UnorderedElementsAre(Pair("uninitialised", DoubleNear(0.1, kTolerance)),
                                   Pair("ok", DoubleNear(0.2, kTolerance)),
                                   Pair("dead_reckoning", DoubleNear(0.1, kTolerance)),
                                   Pair("silent", DoubleNear(0.6, kTolerance))));
  EXPECT_EQ(report->status_spans.size(), 4U);
}

TEST(ReportNumbersTest, TablesOfOtherTimesAreRefusedWithBothTimes) {
  MadeDrive drive;
  drive.fused = MadeDrive::kPoseHeader + MadeDrive::Pose(100, 0.1, 0.1, "ok");
  const auto report = drive.Report();
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(report.error().message,
            "no estimate has a truth at its time: fused.csv goes from 100.000 to 100.000 s, "
            "truth.csv goes from 0.000 to 10.000 s");
}

TEST(ReportNumbersTest, ATableWithoutRowsOrColumnsIsRefused) {
  const auto empty = ParseReportTable(MadeDrive::kPoseHeader, "camera.csv");
  ASSERT_FALSE(empty);
  EXPECT_EQ(empty.error().message, "camera.csv: has no rows, must have at least one");
  const auto other = ParseReportTable("time_ns,speed\n0,1\n", "camera.csv");
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().message, HasSubstr("camera.csv: line 1"));
  EXPECT_THAT(other.error().message, HasSubstr("x_m"));
}

}  // namespace
}  // namespace relocd
