#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/time.h"
#include "geometry/pose2.h"
#include "smoothing/fix.h"
#include "smoothing/fixed_lag_smoother.h"
#include "smoothing/smoother_config.h"

namespace relocd {

/// A drive's odometry and fixes, each by rising time.
struct MotionLog {
  std::vector<OdometryStep> odometry;
  std::vector<Fix> fixes;
};

/// A step of odometry without covariances: they come from its travel, turn and duration.
OdometryStep MakeOdometryStep(MonotonicTime time,
                              Duration duration,
                              const Pose2& motion,
                              const OdometryNoiseConfig& noise);

/// Fixes without covariances: they come from the config.
Fix MakePositionFix(MonotonicTime time, const Eigen::Vector2d& p_WB, const SmootherConfig& config);
Fix MakePoseFix(MonotonicTime time, const Pose2& X_WB, const SmootherConfig& config);

/// For each fix of the log the estimate at its time, from what had arrived by then: the odometry up
/// to it, and all fixes up to and including it.
///
/// @param errors  set to what is known of them in the end, if wanted.
std::vector<SmootherEstimate> SmoothCausally(const MotionLog& log,
                                             const SmootherConfig& config,
                                             SystematicErrors* errors = nullptr);

/// For each fix of the log the estimate at its time from the whole log: the fixed-lag smoother's
/// result as the start of one solution over all keyframes.
std::vector<SmootherEstimate> SmoothAll(const MotionLog& log,
                                        const SmootherConfig& config,
                                        SystematicErrors* errors = nullptr);

}  // namespace relocd
