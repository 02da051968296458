#pragma once

#include <string>

#include "relocd/camera_pose_t.hpp"
#include "relocd/can_frames_t.hpp"
#include "relocd/config_t.hpp"
#include "relocd/image_t.hpp"
#include "relocd/localization_t.hpp"
#include "relocd/odometry_t.hpp"
#include "relocd/pose_t.hpp"
#include "relocd/rigid_transform_t.hpp"
#include "relocd/status_t.hpp"
#include "relocd/supervisor_t.hpp"
#include "relocd/text_t.hpp"
#include "relocd/timesync_t.hpp"

namespace relocd {

/// A channel's name and the type of its messages. Names are of [A-Z0-9_a-z]: LCM reads a name as a
/// regular expression.
template <typename Message>
struct Channel {
  std::string name;
};

/// Every channel there is: docs/messages.md says who publishes it, how often, and in which units.
namespace channels {

inline const Channel<odometry_t> kOdometry{"ODOMETRY"};
inline const Channel<camera_pose_t> kCameraPose{"CAMERA_POSE"};
inline const Channel<localization_t> kLocalization{"LOCALIZATION"};
inline const Channel<pose_t> kPose{"POSE"};
inline const Channel<rigid_transform_t> kMapToOdom{"MAP_TO_ODOM"};
inline const Channel<supervisor_t> kSupervisor{"SUPERVISOR"};
inline const Channel<config_t> kConfig{"CONFIG"};
inline const Channel<timesync_t> kTimesync{"TIMESYNC"};
inline const Channel<text_t> kText{"TEXT"};

}  // namespace channels

/// On the image network; all others are on the control network.
inline Channel<image_t> ImageChannel(const std::string& camera) {
  return {"IMAGE_" + camera};
}
inline Channel<can_frames_t> CanChannel(const std::string& interface) {
  return {"CAN_" + interface};
}
inline Channel<status_t> StatusChannel(const std::string& daemon) {
  return {"STATUS_" + daemon};
}

}  // namespace relocd
