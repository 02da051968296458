#include "calibration/drive_judgement.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include <fmt/format.h>

namespace relocd {
namespace {

/// Steps over which lengths are measured: shorter ones would add up a reference's noise.
constexpr double kStepS = 0.5;

}  // namespace

Result<DriveJudgement> JudgeOdometry(const Trajectory2& X_OBs,
                                     std::int64_t origin_ns,
                                     const std::vector<ReferencePose>& references,
                                     const DriveParameters& parameters) {
  const Pose2 X_RB =
      Pose2(parameters.mount_x_m, parameters.mount_y_m, parameters.mount_yaw_rad).Inverse();
  DriveJudgement judgement;
  std::optional<Pose2> X_WO;
  double odometry_length_m = 0.0;
  double last_s = -std::numeric_limits<double>::infinity();
  for (const ReferencePose& reference : references) {
    const auto time_ns =
        origin_ns + std::llround(1e9 * (reference.time_s + parameters.time_offset_s));
    const auto X_OB = Interpolate(X_OBs, time_ns, std::numeric_limits<std::int64_t>::max());
    const bool is_last = &reference == &references.back();
    if (!X_OB || (reference.time_s < last_s + kStepS && !is_last)) continue;
    Pose2 X_WB = reference.X_WR * X_RB;
    if (!X_WO) {
      if (!reference.has_heading) {
        return Error{ErrorKind::kInvalidInput,
                     "the first pose of the reference has no heading, must have one to compare "
                     "odometry with it"};
      }
      X_WO = X_WB * X_OB->Inverse();
      judgement.begin_s = reference.time_s;
    }
    const Pose2 X_WBo = *X_WO * *X_OB;
    if (!reference.has_heading) {
      // The mounting's lever is laid by odometry's heading.
      const Pose2 X_WR(reference.X_WR.x(), reference.X_WR.y(), X_WBo.yaw());
      X_WB = X_WR * Pose2(-parameters.mount_x_m, -parameters.mount_y_m, 0.0);
    }
    if (!judgement.reference_m.empty()) {
      judgement.length_m += (X_WB.translation() - judgement.reference_m.back()).norm();
      odometry_length_m += (X_WBo.translation() - judgement.odometry_m.back()).norm();
    }
    const Pose2 error = X_WB.Inverse() * X_WBo;
    judgement.heading_error_rad = error.yaw();
    judgement.position_error_m = error.translation().norm();
    judgement.worst_heading_error_rad =
        std::max(judgement.worst_heading_error_rad, std::abs(error.yaw()));
    judgement.worst_position_error_m =
        std::max(judgement.worst_position_error_m, judgement.position_error_m);
    judgement.reference_m.push_back(X_WB.translation());
    judgement.odometry_m.push_back(X_WBo.translation());
    judgement.end_s = last_s = reference.time_s;
  }
  if (judgement.reference_m.size() < 2 || judgement.length_m <= 0.0) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("{} poses of the reference lie within odometry's time, over {:.1f} m, must "
                    "be at least 2 that differ",
                    judgement.reference_m.size(),
                    judgement.length_m)};
  }
  judgement.distance_error = odometry_length_m / judgement.length_m - 1.0;
  return judgement;
}

}  // namespace relocd
