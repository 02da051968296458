#include "evaluation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "geometry/planar.h"
#include "geometry/trajectory.h"

namespace relocd {
namespace {

constexpr double kDegPerRad = 180.0 / std::numbers::pi;
constexpr double kSecondsPerNanosecond = 1e-9;

std::vector<EvaluatedPose> Projected(std::vector<EvaluatedPose> poses, bool planar) {
  if (!planar) return poses;
  for (EvaluatedPose& pose : poses)
    pose.X_WB = LiftFromPlane(ProjectToPlane(pose.X_WB));
  return poses;
}

bool AllHaveHeading(const std::vector<EvaluatedPose>& poses) {
  return std::ranges::all_of(poses, [](const EvaluatedPose& pose) { return pose.has_heading; });
}

Error NothingMatches(const EvaluatedTrajectory& truth, const EvaluatedTrajectory& estimate) {
  const auto range = [](const EvaluatedTrajectory& trajectory) {
    if (trajectory.poses.empty()) return std::string("has no pose");
    return fmt::format(
        "goes from {:.3f} to {:.3f} s",
        static_cast<double>(trajectory.poses.front().time_ns) * kSecondsPerNanosecond,
        static_cast<double>(trajectory.poses.back().time_ns) * kSecondsPerNanosecond);
  };
  return {ErrorKind::kInvalidInput,
          fmt::format("no estimate has a truth at its time: {} {}, {} {}",
                      estimate.path,
                      range(estimate),
                      truth.path,
                      range(truth))};
}

/// Keeps the estimates that have a truth at their time, with it.
void Match(const std::vector<EvaluatedPose>& estimates,
           const EvaluationOptions& options,
           Evaluation& evaluation) {
  Trajectory3 truth;
  for (const EvaluatedPose& pose : evaluation.truths)
    truth.push_back({pose.time_ns, pose.X_WB});
  for (const EvaluatedPose& pose : estimates) {
    const auto true_pose = Interpolate(truth, pose.time_ns, options.max_gap_ns);
    if (true_pose) {
      evaluation.pairs.push_back({pose.time_ns, *true_pose, pose.X_WB});
      evaluation.estimates.push_back(pose);
    } else if (truth.empty() || pose.time_ns < truth.front().time_ns ||
               pose.time_ns > truth.back().time_ns) {
      ++evaluation.outside;
    } else {
      ++evaluation.in_gaps;
    }
  }
}

ErrorSummary InDegrees(std::vector<double> errors_rad) {
  for (double& error : errors_rad)
    error *= kDegPerRad;
  return Summarize(std::move(errors_rad));
}

/// Per length travelled, so that the distance between frames does not matter.
RelativeSummary OverDistance(const std::vector<PosePair>& pairs, double distance_m) {
  RelativeSummary summary{.over = fmt::format("{:g} m", distance_m),
                          .translation_unit = "%",
                          .rotation_unit = "deg/m",
                          .translation = {},
                          .rotation = {}};
  std::vector<double> translations;
  std::vector<double> rotations;
  for (const RelativeError& error : RelativeErrorsOverDistance(pairs, distance_m)) {
    constexpr double kPercent = 100.0;
    translations.push_back(kPercent * error.translation_m / error.travelled_m);
    rotations.push_back(kDegPerRad * error.rotation_rad / error.travelled_m);
  }
  summary.translation = Summarize(std::move(translations));
  summary.rotation = Summarize(std::move(rotations));
  return summary;
}

RelativeSummary OverOneSecond(const std::vector<PosePair>& pairs) {
  RelativeSummary summary{.over = "1 s",
                          .translation_unit = "m",
                          .rotation_unit = "deg",
                          .translation = {},
                          .rotation = {}};
  std::vector<double> translations;
  std::vector<double> rotations;
  for (const RelativeError& error : RelativeErrorsOverTime(pairs, 1'000'000'000)) {
    translations.push_back(error.translation_m);
    rotations.push_back(kDegPerRad * error.rotation_rad);
  }
  summary.translation = Summarize(std::move(translations));
  summary.rotation = Summarize(std::move(rotations));
  return summary;
}

void MeasureCoverage(Evaluation& evaluation) {
  CoverageCounter counter;
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < evaluation.pairs.size(); ++i) {
    const auto& covariance = evaluation.estimates[i].covariance;
    if (!covariance) continue;
    const Eigen::Matrix2d position = covariance->topLeftCorner<2, 2>();
    const Pose2 X_WB = ProjectToPlane(evaluation.pairs[i].X_WB);
    const Pose2 true_pose = ProjectToPlane(evaluation.pairs[i].X_WB_true);
    if (evaluation.has_heading) {
      counter.Add((X_WB.Inverse() * true_pose).Log(), *covariance);
    } else {
      counter.AddPosition(X_WB.Inverse() * true_pose.translation(), position);
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(position);
    sigmas.push_back(std::sqrt(axes.eigenvalues()[1]));
  }
  evaluation.coverage = counter.Total();
  evaluation.median_sigma_m = Summarize(std::move(sigmas)).median;
}

Result<void> Align(Evaluation& evaluation) {
  const auto alignment = AlignToTruth(evaluation.pairs, evaluation.planar);
  if (!alignment) return alignment.error();
  evaluation.alignment = *alignment;
  for (std::size_t i = 0; i < evaluation.pairs.size(); ++i) {
    evaluation.pairs[i].X_WB = *alignment * evaluation.pairs[i].X_WB;
    evaluation.estimates[i].X_WB = evaluation.pairs[i].X_WB;
  }
  evaluation.aligned_position_m = Summarize(PositionErrors(evaluation.pairs));
  if (evaluation.has_heading) {
    evaluation.aligned_rotation_deg = InDegrees(RotationErrors(evaluation.pairs));
  }
  return {};
}

}  // namespace

Result<Evaluation> Evaluate(const EvaluatedTrajectory& truth,
                            const EvaluatedTrajectory& estimate,
                            const EvaluationOptions& options) {
  Evaluation evaluation;
  evaluation.planar = truth.planar || estimate.planar;
  evaluation.truths = Projected(truth.poses, evaluation.planar);
  Match(Projected(estimate.poses, evaluation.planar), options, evaluation);
  const std::vector<PosePair>& pairs = evaluation.pairs;
  if (pairs.empty()) return NothingMatches(truth, estimate);
  evaluation.has_heading =
      AllHaveHeading(evaluation.truths) && AllHaveHeading(evaluation.estimates);
  evaluation.duration_s =
      static_cast<double>(pairs.back().time_ns - pairs.front().time_ns) * kSecondsPerNanosecond;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    evaluation.truth_length_m +=
        (pairs[i].X_WB_true.translation() - pairs[i - 1].X_WB_true.translation()).norm();
  }
  evaluation.position_m = Summarize(PositionErrors(pairs));
  MeasureCoverage(evaluation);
  if (evaluation.has_heading) {
    evaluation.rotation_deg = InDegrees(RotationErrors(pairs));
    for (const double distance_m : {1.0, 10.0, 100.0})
      evaluation.relative.push_back(OverDistance(pairs, distance_m));
    evaluation.relative.push_back(OverOneSecond(pairs));
  }
  if (options.align) {
    if (auto ok = Align(evaluation); !ok) return std::move(ok).error();
  }
  return evaluation;
}

}  // namespace relocd
