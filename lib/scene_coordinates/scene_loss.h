#pragma once

#include <array>
#include <span>

#include <Eigen/Core>

#include "geometry/pose3.h"
#include "scene_coordinates/head.h"
#include "scene_coordinates/training_set.h"

namespace relocd {

/// How an error counts that is larger than the tolerance.
enum class RobustShape {
  kLogarithm,  ///< Less and less, but it never stops to pull: for points that are still far off.
  kTanh,       ///< Hardly at all: for the end, when what is still far off will stay so.
};

/// What the loss of a cell depends on, besides the network's output and the cell's target.
struct SceneLossConfig {
  float focal_px = 0.0F;
  RobustShape shape = RobustShape::kTanh;
  float tolerance_px = 0.0F;
  float depth_baseline_m = 0.0F;
  float depth_weight = 0.0F;
  float typical_depth_m = 0.0F;
  float confident_px = 0.0F;
  Eigen::Vector3f centre_W = Eigen::Vector3f::Zero();
  float scale_m = 1.0F;
};

/// The camera's pose as the loss needs it: p_C = R_CW * (p_W - centre_W) + p_CCentre. Relative to
/// the map's centre, so that floats suffice far from W's origin.
struct LossCamera {
  Eigen::Matrix3f R_CW;
  Eigen::Vector3f p_CCentre;
};

LossCamera MakeLossCamera(const Pose3& X_WC, const Eigen::Vector3d& centre_W);

/// The loss of one cell, its derivatives, and what a report wants to know.
struct SceneLoss {
  float loss = 0.0F;
  std::array<float, kHeadOutputs> gradient{};  ///< d loss / d output.
  float error_px = 0.0F;                       ///< L1 reprojection error.
  bool valid = false;
};

SceneLoss EvaluateSceneLoss(const SceneLossConfig& config,
                            const LossCamera& camera,
                            const TrainingTarget& target,
                            std::span<const float, kHeadOutputs> output);

}  // namespace relocd
