#include "relocalization/camera_pose_estimator.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "relocalization/packed_correspondences.h"
#include "relocalization/pose_ransac.h"
#include "relocalization/pose_refinement.h"
#include "relocalization/soft_inlier_score.h"

namespace relocd {
namespace {

/// Steps that bring a minimal-set hypothesis into the valley that it belongs to.
constexpr int kLocalSteps = 5;
/// A hypothesis with this share of the best one's score might as well be the true one.
constexpr double kNearlyEqual = 0.9;

Pose3 WorldPose(const CameraFromWorld& X_CM, const Eigen::Vector3d& p_WM) {
  const Eigen::Matrix3d R_WC = X_CM.R_CW.transpose();
  return {R_WC, p_WM - R_WC * X_CM.p_CW};
}

std::vector<CameraFromWorld> PriorHypotheses(const std::optional<Pose3>& prior,
                                             const Eigen::Vector3d& p_WM) {
  if (!prior || !prior->translation().allFinite() || !prior->rotation().coeffs().allFinite()) {
    return {};
  }
  const Eigen::Matrix3d R_CW = prior->R().transpose();
  return {{.R_CW = R_CW, .p_CW = R_CW * (p_WM - prior->translation())}};
}

/// The inlier threshold in pixels of this camera.
double ThresholdPx(const CameraPoseOptions& options, const PackedCorrespondences& correspondences) {
  return 1e-3 * options.inlier_threshold_mrad * std::sqrt(correspondences.focal().prod());
}

/// Refines each hypothesis on the random subset and scores it on everything; best first.
void RefineLocally(const PackedCorrespondences& correspondences,
                   const CameraPoseOptions& options,
                   std::vector<PoseHypothesis>& hypotheses) {
  const double threshold_px = ThresholdPx(options, correspondences);
  const RefinementSchedule schedule{.steps = kLocalSteps,
                                    .start_threshold_px = 2.0 * threshold_px,
                                    .end_threshold_px = threshold_px};
  for (PoseHypothesis& hypothesis : hypotheses) {
    const RefinedPose refined = RefinePose(correspondences,
                                           static_cast<std::size_t>(options.scored_points),
                                           hypothesis.X_CM,
                                           schedule);
    const double score =
        SoftInlierScore(correspondences, correspondences.size(), refined.X_CM, threshold_px);
    if (!(score > hypothesis.score)) continue;
    hypothesis.X_CM = refined.X_CM;
    hypothesis.score = score;
  }
  std::ranges::sort(hypotheses, IsBetter);
}

/// The scatter of the hypotheses that are nearly as good as the first around it: nothing where all
/// lead to one pose, much where a place looks like another.
Matrix6d SpreadOfNearlyEqual(const std::vector<PoseHypothesis>& hypotheses) {
  const Pose3 X_MC = WorldPose(hypotheses.front().X_CM, Eigen::Vector3d::Zero());
  Matrix6d spread = Matrix6d::Zero();
  double sum = 0.0;
  for (const PoseHypothesis& other : hypotheses) {
    if (other.score < kNearlyEqual * hypotheses.front().score) break;
    const Vector6d difference =
        (X_MC.Inverse() * WorldPose(other.X_CM, Eigen::Vector3d::Zero())).Log();
    spread += other.score * difference * difference.transpose();
    sum += other.score;
  }
  return spread / sum;
}

RefinedPose RefineOnAll(const PackedCorrespondences& correspondences,
                        const CameraPoseOptions& options,
                        const PoseHypothesis& best) {
  const double threshold_px = ThresholdPx(options, correspondences);
  RefinementSchedule schedule{.steps = options.refinement_steps,
                              .start_threshold_px = threshold_px,
                              .end_threshold_px = 0.5 * threshold_px};
  RefinedPose refined = RefinePose(correspondences, correspondences.size(), best.X_CM, schedule);
  const double score =
      SoftInlierScore(correspondences, correspondences.size(), refined.X_CM, threshold_px);
  if (score > kNearlyEqual * best.score) return refined;
  schedule.steps = 0;  // it ran away: stay, and say how certain that is
  return RefinePose(correspondences, correspondences.size(), best.X_CM, schedule);
}

Matrix6d CalibratedCovariance(const Matrix6d& covariance,
                              const Matrix6d& spread,
                              const PoseCalibration& calibration) {
  Vector6d floor;
  floor << Eigen::Vector3d::Constant(calibration.translation_floor_sigma_m),
      Eigen::Vector3d::Constant(calibration.rotation_floor_sigma_rad);
  Matrix6d calibrated = calibration.covariance_scale * (covariance + spread);
  calibrated.diagonal() += floor.cwiseAbs2();
  return calibrated;
}

bool IsDetermined(const Matrix6d& covariance, const CameraPoseOptions& options) {
  if (!covariance.allFinite()) return false;
  const auto max_variance = [](const Eigen::Matrix3d& block) {
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(block, Eigen::EigenvaluesOnly)
        .eigenvalues()
        .maxCoeff();
  };
  return max_variance(covariance.topLeftCorner<3, 3>()) <
             options.max_sigma_t_m * options.max_sigma_t_m &&
         max_variance(covariance.bottomRightCorner<3, 3>()) <
             options.max_sigma_r_rad * options.max_sigma_r_rad;
}

Error OutOfRange(std::string_view field, double value, std::string_view allowed) {
  return {ErrorKind::kInvalidInput, fmt::format("{} is {}, must be {}", field, value, allowed)};
}

}  // namespace

Result<void> CameraPoseOptions::Validate() const {
  struct Limit {
    std::string_view field;
    double value;
    double low;
    double high;
  };
  const Limit limits[] = {{"hypotheses", 1.0 * hypotheses, 1.0, 1e4},
                          {"max_tries", 1.0 * max_tries, 1.0, 1e6},
                          {"scored_points", 1.0 * scored_points, 4.0, 1e5},
                          {"refined_hypotheses", 1.0 * refined_hypotheses, 1.0, 1e3},
                          {"refinement_steps", 1.0 * refinement_steps, 1.0, 100.0},
                          {"inlier_threshold_mrad", inlier_threshold_mrad, 0.1, 1e3}};
  for (const Limit& limit : limits) {
    if (!(limit.value >= limit.low && limit.value <= limit.high)) {
      return OutOfRange(
          limit.field, limit.value, fmt::format("in [{}, {}]", limit.low, limit.high));
    }
  }
  if (!(max_sigma_t_m > 0.0)) return OutOfRange("max_sigma_t_m", max_sigma_t_m, "> 0");
  if (!(max_sigma_r_rad > 0.0)) return OutOfRange("max_sigma_r_rad", max_sigma_r_rad, "> 0");
  return {};
}

std::string_view Name(CameraPoseStatus status) {
  switch (status) {
    case CameraPoseStatus::kOk:
      return "ok";
    case CameraPoseStatus::kNoHypothesis:
      return "no_hypothesis";
    case CameraPoseStatus::kLowConfidence:
      return "low_confidence";
    case CameraPoseStatus::kDegenerate:
      return "degenerate";
    case CameraPoseStatus::kOffRoute:
      return "off_route";
  }
  return "unknown";
}

CameraPoseResult EstimateCameraPose(std::span<const Correspondence> correspondences,
                                    const PinholeCamera& camera,
                                    const CameraPoseOptions& options,
                                    const std::optional<Pose3>& prior,
                                    std::uint64_t seed) {
  const PackedCorrespondences packed(correspondences, camera, seed);
  const double threshold_px = ThresholdPx(options, packed);
  PoseRansacResult found = FindPoses(packed,
                                     {.hypotheses = options.hypotheses,
                                      .max_tries = options.max_tries,
                                      .kept = options.refined_hypotheses,
                                      .scored_points = options.scored_points,
                                      .threshold_px = threshold_px},
                                     PriorHypotheses(prior, packed.p_WM()),
                                     seed);
  CameraPoseResult result;
  result.correspondences = static_cast<int>(correspondences.size());
  result.hypotheses = found.hypotheses;
  if (found.best.empty()) {
    const bool degenerate = 2 * found.degenerate_tries > found.tries;
    result.status = degenerate ? CameraPoseStatus::kDegenerate : CameraPoseStatus::kNoHypothesis;
    return result;
  }

  RefineLocally(packed, options, found.best);
  const RefinedPose refined = RefineOnAll(packed, options, found.best.front());
  const InlierCount inliers = CountInliers(packed, refined.X_CM, threshold_px);
  result.inliers = static_cast<int>(inliers.inliers);
  result.reprojection_rms_px = inliers.rms_px;
  result.confidence = SoftInlierScore(packed, packed.size(), refined.X_CM, threshold_px) /
                      static_cast<double>(correspondences.size());
  if (!(result.confidence >= options.calibration.min_confidence)) {
    result.status = CameraPoseStatus::kLowConfidence;
    return result;
  }
  const Matrix6d covariance = CalibratedCovariance(
      refined.covariance, SpreadOfNearlyEqual(found.best), options.calibration);
  if (refined.degenerate || !IsDetermined(covariance, options)) {
    result.status = CameraPoseStatus::kDegenerate;
    return result;
  }
  result.status = CameraPoseStatus::kOk;
  result.X_WC = WorldPose(refined.X_CM, packed.p_WM());
  result.covariance = covariance;
  return result;
}

}  // namespace relocd
