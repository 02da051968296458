#include "evaluation.h"

#include <cmath>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/csv.h"
#include "geometry/planar.h"
#include "support/random.h"
#include "support/shared_data.h"

namespace relocd {
namespace {

using testing::HasSubstr;

constexpr double kTolerance = 1e-9;
constexpr std::int64_t kPeriodNs = 100'000'000;

/// A drive along a wide circle at 2 m/s, ten poses a second.
EvaluatedTrajectory MakeTruth(int count) {
  EvaluatedTrajectory truth{
      .path = "truth.csv", .planar = true, .rows = 0, .poses = {}, .rows_without_pose = {}};
  Pose2 X_WB(5.0, -3.0, 0.4);
  for (int i = 0; i < count; ++i) {
    truth.poses.push_back({.time_ns = i * kPeriodNs,
                           .X_WB = LiftFromPlane(X_WB),
                           .has_heading = true,
                           .covariance = std::nullopt});
    X_WB = X_WB * Pose2::Exp({0.2, 0.0, 0.01});
  }
  truth.rows = truth.poses.size();
  return truth;
}

Evaluation MustEvaluate(const EvaluatedTrajectory& truth,
                        const EvaluatedTrajectory& estimate,
                        const EvaluationOptions& options = {}) {
  auto evaluation = Evaluate(truth, estimate, options);
  EXPECT_TRUE(evaluation) << evaluation.error().message;
  return std::move(evaluation).value();
}

TEST(EvaluationTest, ThePerfectEstimateHasNoErrors) {
  const auto truth = MakeTruth(300);
  const Evaluation evaluation = MustEvaluate(truth, truth);
  EXPECT_EQ(evaluation.pairs.size(), 300U);
  EXPECT_TRUE(evaluation.planar);
  EXPECT_NEAR(evaluation.position_m.max, 0.0, kTolerance);
  EXPECT_NEAR(evaluation.rotation_deg.max, 0.0, 1e-5);
  EXPECT_NEAR(evaluation.duration_s, 29.9, kTolerance);
  EXPECT_NEAR(evaluation.truth_length_m, 299 * 0.2, 1e-3);
  ASSERT_EQ(evaluation.relative.size(), 4U);
  EXPECT_EQ(evaluation.relative[2].translation.count, 0U);  // the way is shorter than 100 m
  EXPECT_EQ(evaluation.coverage.position_count, 0U);
}

TEST(EvaluationTest, InterpolatesTheTruthAndCountsWhatHasNone) {
  auto truth = MakeTruth(100);
  truth.poses.erase(truth.poses.begin() + 40, truth.poses.begin() + 60);  // a hole of 2.1 s
  auto estimate = MakeTruth(100);
  for (EvaluatedPose& pose : estimate.poses) {
    const Pose2 X_WB = ProjectToPlane(pose.X_WB) * Pose2::Exp({0.1, 0.0, 0.005});
    pose.X_WB = LiftFromPlane(X_WB);
    pose.time_ns += kPeriodNs / 2;
  }
  const Evaluation evaluation = MustEvaluate(truth, estimate);
  EXPECT_EQ(evaluation.outside, 1U);
  EXPECT_EQ(evaluation.in_gaps, 21U);
  EXPECT_EQ(evaluation.pairs.size(), 78U);
  EXPECT_NEAR(evaluation.position_m.max, 0.0, 1e-9);
  EXPECT_EQ(MustEvaluate(truth, estimate, {.max_gap_ns = 3'000'000'000}).in_gaps, 0U);
}

TEST(EvaluationTest, AlignmentTakesAMoveAwayAndKeepsTheErrorsBefore) {
  const auto truth = MakeTruth(300);
  auto estimate = truth;
  for (EvaluatedPose& pose : estimate.poses)
    pose.X_WB = LiftFromPlane(Pose2(3.0, 4.0, 0.0)) * pose.X_WB;
  const Evaluation evaluation = MustEvaluate(truth, estimate, {.align = true});
  EXPECT_NEAR(evaluation.position_m.rmse, 5.0, kTolerance);
  EXPECT_NEAR(evaluation.aligned_position_m.rmse, 0.0, kTolerance);
  ASSERT_TRUE(evaluation.alignment);
  EXPECT_NEAR(evaluation.alignment->translation().x(), -3.0, kTolerance);
  EXPECT_NEAR(evaluation.relative[1].translation.max, 0.0, 1e-6);
}

TEST(EvaluationTest, HeadingErrorsWrapAround) {
  auto truth = MakeTruth(2);
  auto estimate = truth;
  truth.poses[0].X_WB = LiftFromPlane(Pose2(0.0, 0.0, std::numbers::pi - 0.01));
  estimate.poses[0].X_WB = LiftFromPlane(Pose2(0.0, 0.0, -std::numbers::pi + 0.02));
  EXPECT_NEAR(
      MustEvaluate(truth, estimate).rotation_deg.max, 0.03 * 180.0 / std::numbers::pi, 1e-6);
}

TEST(EvaluationTest, MeasuresCoverageInTheAxesOfTheEstimate) {
  const auto truth = MakeTruth(4000);
  TestRandom random(3);
  auto estimate = truth;
  for (EvaluatedPose& pose : estimate.poses) {
    // Far along, little across: only in the body's axes are these the right ellipses.
    const Eigen::Vector3d sigma(1.0, 0.1, 0.02);
    const Eigen::Vector3d error(
        random.Normal(sigma.x()), random.Normal(sigma.y()), random.Normal(sigma.z()));
    pose.X_WB = LiftFromPlane(ProjectToPlane(pose.X_WB) * Pose2::Exp(error).Inverse());
    pose.covariance = sigma.cwiseProduct(sigma).asDiagonal().toDenseMatrix();
  }
  const Evaluation evaluation = MustEvaluate(truth, estimate);
  EXPECT_EQ(evaluation.coverage.pose_count, 4000U);
  EXPECT_NEAR(evaluation.coverage.position_share, 0.95, 0.011);  // 3 sigma of 4000 draws
  EXPECT_NEAR(evaluation.coverage.pose_share, 0.95, 0.011);
  EXPECT_NEAR(evaluation.coverage.pose_nees, 3.0, 0.12);
  EXPECT_NEAR(evaluation.median_sigma_m, 1.0, kTolerance);
}

TEST(EvaluationTest, PositionsWithoutHeadingHaveNoHeadingErrors) {
  const auto truth = MakeTruth(100);
  auto estimate = truth;
  for (EvaluatedPose& pose : estimate.poses) {
    pose.X_WB =
        LiftFromPlane(Pose2(pose.X_WB.translation().x() + 1.0, pose.X_WB.translation().y(), 0.0));
    pose.has_heading = false;
    pose.covariance = Eigen::Vector3d(0.3, 100.0, 0.0).asDiagonal().toDenseMatrix();
  }
  const Evaluation evaluation = MustEvaluate(truth, estimate);
  EXPECT_FALSE(evaluation.has_heading);
  EXPECT_TRUE(evaluation.relative.empty());
  EXPECT_NEAR(evaluation.position_m.mean, 1.0, kTolerance);
  EXPECT_EQ(evaluation.coverage.pose_count, 0U);
  EXPECT_NEAR(evaluation.coverage.position_nees, 1.0 / 0.3, kTolerance);
  EXPECT_THAT(FormatTable(evaluation, truth, estimate), testing::Not(HasSubstr("heading")));
}

TEST(EvaluationTest, NoCommonTimeIsAnErrorThatSaysBoth) {
  const auto truth = MakeTruth(10);
  auto estimate = MakeTruth(10);
  estimate.path = "est.csv";
  for (EvaluatedPose& pose : estimate.poses)
    pose.time_ns += 100'000'000'000;
  const auto evaluation = Evaluate(truth, estimate, {});
  ASSERT_FALSE(evaluation);
  EXPECT_EQ(
      evaluation.error().message,
      "no estimate has a truth at its time: est.csv goes from 100.000 to 100.900 s, truth.csv "
      "goes from 0.000 to 0.900 s");
}

TEST(EvaluationTest, TheTableSaysWhatWasNotCompared) {
  const auto truth = MakeTruth(100);
  auto estimate = truth;
  estimate.path = "est.csv";
  estimate.rows = 103;
  estimate.rows_without_pose = {{"lost", 3}};
  const std::string table =
      FormatTable(MustEvaluate(truth, estimate, {.align = true}), truth, estimate);
  EXPECT_THAT(table, HasSubstr("estimate  est.csv: 103 rows (without a pose: 3 lost)\n"));
  EXPECT_THAT(table, HasSubstr("matched   100 of 100 poses over 9.9 s and 19.8 m, in the plane"));
  EXPECT_THAT(table, HasSubstr("\nposition [m] "));
  EXPECT_THAT(table, HasSubstr("\naligned heading [deg] "));
  EXPECT_THAT(table, HasSubstr("\nover 10 m position [%] "));
  EXPECT_THAT(table, HasSubstr("no covariance is reported"));
}

TEST(EvaluationTest, TheJsonIsOneObject) {
  const auto truth = MakeTruth(100);
  auto estimate = truth;
  estimate.path = "a \"quoted\" name";
  estimate.rows_without_pose = {{"lost", 3}};
  const std::string json = FormatJson(MustEvaluate(truth, estimate), truth, estimate);
  EXPECT_THAT(
      json, testing::StartsWith("{\"truth\":\"truth.csv\",\"estimate\":\"a \\\"quoted\\\" name\""));
  EXPECT_THAT(json, HasSubstr("\"without_pose\":{\"lost\":3},\"matched\":100"));
  EXPECT_THAT(json, HasSubstr("\"position_m\":{\"count\":100,\"mean\":0,\"rmse\":0"));
  EXPECT_THAT(json, testing::EndsWith("}\n"));
  EXPECT_EQ(std::ranges::count(json, '{'), std::ranges::count(json, '}'));
}

/// The columns of the data set as the CSV that the evaluation reads.
std::string NcltColumns(const CsvTable& table, const std::string& x, const std::string& y) {
  const auto columns = table.Columns({"timestamp_us", x, y});
  EXPECT_TRUE(columns);
  std::string text = "time_ns,x_m,y_m\n";
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    text += fmt::format("{}000,{},{}\n",
                        table.Text(row, (*columns)[0]),
                        table.Text(row, (*columns)[1]),
                        table.Text(row, (*columns)[2]));
  }
  return text;
}

TEST(NcltTest, TheErrorsOfTheReleasedRunAreFound) {
  const std::string folder = SharedData("nclt_godsac");
  if (folder.empty()) GTEST_SKIP() << SharedDataReason("nclt_godsac");
  const auto table = CsvTable::Read(folder + "/frames.csv");
  ASSERT_TRUE(table) << table.error().message;
  const auto truth = ParseEvaluatedTrajectory(NcltColumns(*table, "gt_x", "gt_y"), "truth");
  const auto predicted = ParseEvaluatedTrajectory(NcltColumns(*table, "pred_x", "pred_y"), "p");
  ASSERT_TRUE(truth) << truth.error().message;
  ASSERT_TRUE(predicted) << predicted.error().message;
  const Evaluation evaluation = MustEvaluate(*truth, *predicted);
  // Worked out row by row here, in another way.
  const auto columns = table->Columns({"gt_x", "gt_y", "pred_x", "pred_y"});
  std::vector<double> errors;
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    errors.push_back(
        std::hypot(*table->Double(row, (*columns)[0]) - *table->Double(row, (*columns)[2]),
                   *table->Double(row, (*columns)[1]) - *table->Double(row, (*columns)[3])));
  }
  std::ranges::sort(errors);
  EXPECT_EQ(evaluation.pairs.size(), 900U);
  EXPECT_NEAR(evaluation.position_m.median, 0.5 * (errors[449] + errors[450]), 1e-6);
  EXPECT_NEAR(evaluation.position_m.max, errors.back(), 1e-6);
  EXPECT_NEAR(evaluation.position_m.mean, 11.30, 0.01);  // of all 1500 frames: 12.32
  EXPECT_NEAR(evaluation.position_m.rmse, 16.38, 0.01);  // of all 1500 frames: 17.94
}

}  // namespace
}  // namespace relocd
