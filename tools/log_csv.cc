#include "log_csv.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <string_view>

#include <Eigen/Core>
#include <fmt/format.h>

#include "geometry/planar.h"
#include "messaging/message_bus.h"
#include "status_report.h"

namespace relocd {
namespace {

using RowMajorMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMajorMatrix6d = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

void AppendPose(std::int64_t time_ns,
                const PlanarPose& pose,
                std::string_view status,
                std::string& text) {
  const Eigen::Matrix3d& c = pose.covariance;
  fmt::format_to(std::back_inserter(text),
                 "{},{},{},{},{},{},{},{},{},{},{}",
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

/// The row of a message without a pose: only its time and the reason.
void AppendNoPose(std::int64_t time_ns, std::string_view status, std::string& text) {
  fmt::format_to(std::back_inserter(text), "{},,,,,,,,,,{}", time_ns, status);
}

/// As `reloc smooth` writes it.
std::string NameOfStatus(const localization_t& message) {
  std::string name = NameOfLocalizationStatus(message.status);
  std::ranges::transform(name, name.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return name;
}

/// As `reloc map localize` writes it.
std::string NameOfStatus(const camera_pose_t& message) {
  constexpr std::array<std::string_view, 7> kNames{"ok",
                                                   "bad_image",
                                                   "wrong_size",
                                                   "no_hypothesis",
                                                   "low_confidence",
                                                   "degenerate",
                                                   "off_route"};
  const auto status = static_cast<std::size_t>(message.status);
  return status < kNames.size() ? std::string(kNames.at(status))
                                : fmt::format("unknown ({})", message.status);
}

bool AppendLocalization(std::span<const std::uint8_t> bytes,
                        std::int64_t origin_ns,
                        std::string& text) {
  const auto message = DecodeBounded<localization_t>(bytes);
  if (!message) return false;
  const std::int64_t time_ns = message->mono_ns - origin_ns;
  if (message->status == localization_t::UNINITIALISED) {
    AppendNoPose(time_ns, NameOfStatus(*message), text);
  } else {
    AppendPose(time_ns,
               {.X_WB = Pose2(message->x_WB_m, message->y_WB_m, message->yaw_WB_rad),
                .covariance = Eigen::Map<const RowMajorMatrix3d>(&message->covariance[0])},
               NameOfStatus(*message),
               text);
  }
  text += '\n';
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

/// A body at the camera's place, x along the optical axis, z up.
Pose3 CameraAsBody() {
  constexpr double kQuarterTurn = 1.5707963267948966;
  return {RotationFromRollPitchYaw(-kQuarterTurn, 0.0, -kQuarterTurn), Eigen::Vector3d::Zero()};
}

/// The body's pose where `X_BC` says where this camera is, else the camera's.
bool AppendCameraPose(std::span<const std::uint8_t> bytes,
                      const LogCsvOptions& options,
                      std::string& text) {
  const auto message = DecodeBounded<camera_pose_t>(bytes);
  if (!message) return false;
  const std::int64_t time_ns = message->mono_ns - options.time_origin_ns;
  const auto mounted = options.X_BC.find(message->camera);
  const bool is_mounted = mounted != options.X_BC.end();
  if (message->status != camera_pose_t::STATUS_OK) {
    AppendNoPose(time_ns, NameOfStatus(*message), text);
  } else if (!is_mounted && !options.X_BC.empty()) {
    AppendNoPose(time_ns, "unknown_camera", text);
  } else {
    const Eigen::Quaterniond q_WC(
        message->quat[0], message->quat[1], message->quat[2], message->quat[3]);
    const Pose3 X_WC(q_WC, {message->pos[0], message->pos[1], message->pos[2]});
    const Pose3 X_BC = is_mounted ? mounted->second : CameraAsBody();
    const Matrix6d covariance = Eigen::Map<const RowMajorMatrix6d>(&message->covariance[0]);
    AppendPose(time_ns,
               ProjectToPlane(X_WC * X_BC.Inverse(), TransportCovariance(covariance, X_BC)),
               NameOfStatus(*message),
               text);
  }
  fmt::format_to(std::back_inserter(text), ",{},{:.4f}\n", message->inliers, message->confidence);
  return true;
}

}  // namespace

Result<LogCsv> LogCsv::ForChannel(const std::string& channel, const LogCsvOptions& options) {
  const std::string pose_header =
      "time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,status";
  if (channel == channels::kLocalization.name) {
    return LogCsv(pose_header + "\n", [options](auto bytes, std::string& text) {
      return AppendLocalization(bytes, options.time_origin_ns, text);
    });
  }
  if (channel == channels::kOdometry.name) {
    return LogCsv("time_ns,x_m,y_m,heading_rad,flags\n", [options](auto bytes, std::string& text) {
      return AppendOdometry(bytes, options.time_origin_ns, text);
    });
  }
  if (channel == channels::kCameraPose.name) {
    return LogCsv(pose_header + ",inliers,confidence\n", [options](auto bytes, std::string& text) {
      return AppendCameraPose(bytes, options, text);
    });
  }
  return Error{ErrorKind::kInvalidInput,
               fmt::format("--channel is '{}', must be {}", channel, kChannels)};
}

}  // namespace relocd
