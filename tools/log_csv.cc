#include "log_csv.h"

#include <iterator>
#include <utility>

#include <Eigen/Core>
#include <fmt/format.h>

#include "geometry/planar.h"
#include "messaging/message_bus.h"

namespace relocd {
namespace {

using RowMajorMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMajorMatrix6d = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

void AppendPose(std::int64_t time_ns, const PlanarPose& pose, int status, std::string& text) {
  const Eigen::Matrix3d& c = pose.covariance;
  fmt::format_to(std::back_inserter(text),
                 "{},{},{},{},{},{},{},{},{},{},{}\n",
                 time_ns,
                 pose.X_WB.x(),
                 pose.X_WB.y(),
                 pose.X_WB.yaw(),
                 c(0, 0),
                 c(0, 1),
                 c(0, 2),
                 c(1, 1),
                 c(1, 2),
                 c(2, 2),
                 status);
}

bool AppendLocalization(std::span<const std::uint8_t> bytes,
                        std::int64_t origin_ns,
                        std::string& text) {
  const auto message = DecodeBounded<localization_t>(bytes);
  if (!message) return false;
  if (message->status == localization_t::UNINITIALISED) return true;
  const PlanarPose pose{.X_WB = Pose2(message->x_WB_m, message->y_WB_m, message->yaw_WB_rad),
                        .covariance = Eigen::Map<const RowMajorMatrix3d>(&message->covariance[0])};
  AppendPose(message->mono_ns - origin_ns, pose, message->status, text);
  return true;
}

bool AppendOdometry(std::span<const std::uint8_t> bytes,
                    std::int64_t origin_ns,
                    std::string& text) {
  const auto message = DecodeBounded<odometry_t>(bytes);
  if (!message) return false;
  fmt::format_to(std::back_inserter(text),
                 "{},{},{},{},{}\n",
                 message->mono_ns - origin_ns,
                 message->x_OB_m,
                 message->y_OB_m,
                 message->yaw_OB_rad,
                 message->flags);
  return true;
}

bool AppendCameraPose(std::span<const std::uint8_t> bytes,
                      std::int64_t origin_ns,
                      std::string& text) {
  const auto message = DecodeBounded<camera_pose_t>(bytes);
  if (!message) return false;
  if (message->status != camera_pose_t::STATUS_OK) return true;
  const Eigen::Quaterniond q_WC(
      message->quat[0], message->quat[1], message->quat[2], message->quat[3]);
  const Pose3 X_WC(q_WC, {message->pos[0], message->pos[1], message->pos[2]});
  // A body at the camera's place, x along the optical axis, z up.
  constexpr double kQuarterTurn = 1.5707963267948966;
  const Pose3 X_BC(RotationFromRollPitchYaw(-kQuarterTurn, 0.0, -kQuarterTurn),
                   Eigen::Vector3d::Zero());
  const Matrix6d covariance = Eigen::Map<const RowMajorMatrix6d>(&message->covariance[0]);
  AppendPose(message->mono_ns - origin_ns,
             ProjectToPlane(X_WC * X_BC.Inverse(), TransportCovariance(covariance, X_BC)),
             message->status,
             text);
  return true;
}

}  // namespace

Result<LogCsv> LogCsv::ForChannel(const std::string& channel, std::int64_t time_origin_ns) {
  constexpr const char* kPoseHeader =
      "time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,status\n";
  constexpr const char* kOdometryHeader = "time_ns,x_m,y_m,heading_rad,flags\n";
  const auto make = [time_origin_ns](const char* header, auto* append) {
    return LogCsv(header,
                  [append, time_origin_ns](std::span<const std::uint8_t> bytes, std::string& text) {
                    return append(bytes, time_origin_ns, text);
                  });
  };
  if (channel == channels::kLocalization.name) return make(kPoseHeader, &AppendLocalization);
  if (channel == channels::kOdometry.name) return make(kOdometryHeader, &AppendOdometry);
  if (channel == channels::kCameraPose.name) return make(kPoseHeader, &AppendCameraPose);
  return Error{ErrorKind::kInvalidInput,
               fmt::format("--channel is '{}', must be {}", channel, kChannels)};
}

}  // namespace relocd
