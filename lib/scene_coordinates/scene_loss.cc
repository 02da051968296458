#include "scene_coordinates/scene_loss.h"

#include <algorithm>
#include <cmath>

namespace relocd {
namespace {

/// Points nearer than this, or behind, are not projected.
constexpr float kMinDepthM = 0.1F;
/// Points with larger reprojection errors are pulled by their distance in space instead: the
/// derivative of a projection far off says little about where to go.
constexpr float kMaxErrorPx = 1000.0F;
/// Points this many times farther than the target's depth likewise.
constexpr float kMaxDepthRatio = 100.0F;

/// Of the confidence's cross-entropy against the pixels.
constexpr float kConfidenceWeight = 0.5F;

float Sign(float value) {
  return value > 0.0F ? 1.0F : (value < 0.0F ? -1.0F : 0.0F);
}

/// An error and how it is squashed.
struct Squashed {
  float value = 0.0F;
  float slope = 0.0F;
};

Squashed Squash(float error, const SceneLossConfig& config) {
  const float ratio = error / config.tolerance_px;
  if (config.shape == RobustShape::kLogarithm) {
    return {config.tolerance_px * std::log1p(ratio), 1.0F / (1.0F + ratio)};
  }
  const float squashed = std::tanh(ratio);
  return {config.tolerance_px * squashed, 1.0F - squashed * squashed};
}

}  // namespace

LossCamera MakeLossCamera(const Pose3& X_WC, const Eigen::Vector3d& centre_W) {
  return {X_WC.R().transpose().cast<float>(), (X_WC.Inverse() * centre_W).cast<float>()};
}

SceneLoss EvaluateSceneLoss(const SceneLossConfig& config,
                            const LossCamera& camera,
                            const TrainingTarget& target,
                            std::span<const float, kHeadOutputs> output) {
  const float homogeneous = HomogeneousScale(output[3]);
  // O is the head's centre.
  const Eigen::Vector3f p_OP =
      Eigen::Vector3f(output[0], output[1], output[2]) * (config.scale_m / homogeneous);
  const Eigen::Vector3f p_CP = camera.R_CW * p_OP + camera.p_CCentre;
  const float target_depth =
      target.inverse_depth > 0.0F ? 1.0F / target.inverse_depth : config.typical_depth_m;

  SceneLoss result;
  const float inverse_z = 1.0F / std::max(p_CP.z(), kMinDepthM);
  const float x = p_CP.x() * inverse_z;
  const float y = p_CP.y() * inverse_z;
  const float error_u = config.focal_px * (x - target.x);
  const float error_v = config.focal_px * (y - target.y);
  result.error_px = std::abs(error_u) + std::abs(error_v);
  result.valid = p_CP.z() > kMinDepthM && p_CP.z() < kMaxDepthRatio * target_depth &&
                 result.error_px < kMaxErrorPx;

  Eigen::Vector3f d_CP;  // d loss / d p_CP
  float error_disparity = 0.0F;
  if (result.valid) {
    const Squashed reprojection = Squash(result.error_px, config);
    result.loss = reprojection.value;
    const float d_x = config.focal_px * reprojection.slope * Sign(error_u);
    const float d_y = config.focal_px * reprojection.slope * Sign(error_v);
    d_CP = Eigen::Vector3f(d_x, d_y, -(d_x * x + d_y * y)) * inverse_z;
    if (target.inverse_depth > 0.0F) {
      const float disparity_per_inverse_depth = config.focal_px * config.depth_baseline_m;
      error_disparity = disparity_per_inverse_depth * (inverse_z - target.inverse_depth);
      const Squashed depth = Squash(std::abs(error_disparity), config);
      result.loss += config.depth_weight * depth.value;
      d_CP.z() -= config.depth_weight * depth.slope * Sign(error_disparity) *
                  disparity_per_inverse_depth * inverse_z * inverse_z;
    }
  } else {
    // In units of pixels too, at the target's depth.
    const float weight = config.focal_px / target_depth;
    const Eigen::Vector3f error = p_CP - Eigen::Vector3f(target.x, target.y, 1.0F) * target_depth;
    result.loss = weight * error.cwiseAbs().sum();
    d_CP = weight * Eigen::Vector3f(Sign(error.x()), Sign(error.y()), Sign(error.z()));
  }

  const Eigen::Vector3f d_WP = camera.R_CW.transpose() * d_CP;
  const Eigen::Vector3f d_output = d_WP * (config.scale_m / homogeneous);
  const float d_homogeneous = -d_WP.dot(p_OP) / homogeneous;
  const bool is_right = result.valid && result.error_px < config.confident_px &&
                        std::abs(error_disparity) < config.confident_px;
  const float confidence = 1.0F / (1.0F + std::exp(-output[4]));
  result.gradient = {d_output.x(),
                     d_output.y(),
                     d_output.z(),
                     d_homogeneous * HomogeneousScaleSlope(output[3]),
                     kConfidenceWeight * (confidence - (is_right ? 1.0F : 0.0F))};
  return result;
}

}  // namespace relocd
