#include "calibration/drive_judgement.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include <fmt/format.h>

namespace relocd {

Result<DriveJudgement> JudgeOdometry(const Trajectory2& X_OBs,
                                     std::int64_t origin_ns,
                                     const std::vector<ReferencePose>& bodies,
                                     double time_offset_s) {
  DriveJudgement judgement;
  std::optional<Pose2> X_WO;
  double odometry_length_m = 0.0;
  for (const ReferencePose& body : bodies) {
    const auto time_ns = origin_ns + std::llround(1e9 * (body.time_s + time_offset_s));
    const auto X_OB = Interpolate(X_OBs, time_ns, std::numeric_limits<std::int64_t>::max());
    if (!X_OB) continue;
    const Pose2& X_WB = body.X_WR;
    if (!X_WO) {
      X_WO = X_WB * X_OB->Inverse();
      judgement.begin_s = body.time_s;
    }
    const Pose2 X_WBo = *X_WO * *X_OB;
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
    judgement.end_s = body.time_s;
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
