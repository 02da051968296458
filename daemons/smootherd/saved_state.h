#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "core/result.h"
#include "core/time.h"
#include "geometry/pose2.h"

namespace relocd {

/// What one run of smootherd leaves for the next.
struct SavedState {
  std::string boot_id;  ///< CLOCK_MONOTONIC begins anew with each boot.
  MonotonicTime time{};
  std::int64_t odometry_run_id = 0;  ///< Which O the X_OB below is in.
  std::string map_id;                ///< Which W: empty before the first fix.
  Pose2 X_WB;
  Pose2 X_OB;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< Of X_WB's right perturbation.
};

/// Lines of `key: value`, all keys, in this order.
std::string FormatSavedState(const SavedState& state);

/// @param path  for messages.
/// @return kInvalidInput with file, line and what is allowed: an unknown, missing or repeated key,
/// a number that is none or not finite, a covariance that is none.
Result<SavedState> ParseSavedState(std::string_view text, const std::string& path);

}  // namespace relocd
