#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "relocd/camera_pose_t.hpp"
#include "relocd/localization_t.hpp"
#include "relocd/odometry_t.hpp"
#include "relocd/pose_t.hpp"

#include "core/time.h"
#include "geometry/pose2.h"
#include "geometry/pose3.h"
#include "messaging/latency_window.h"
#include "messaging/message_bus.h"
#include "messaging/node_status.h"
#include "smootherd/saved_state.h"
#include "smoothing/fixed_lag_smoother.h"
#include "smoothing/localization_config.h"

namespace relocd {

/// Odometry in, the vehicle's pose out at once; camera poses in, and the estimate of where the
/// odometry frame lies in the map moves.
///
/// The pose of an odometry message never waits for a camera's: it is published before anything is
/// solved. Reads no clock. Borrows the bus, which must outlive it. Thread-bound.
class SmootherNode {
 public:
  /// @param config  valid.
  /// @param X_BC    where each camera is on the vehicle, by its name in the config.
  SmootherNode(const LocalizationConfig& config,
               std::map<std::string, Pose3> X_BC,
               MessageBus& bus,
               std::int64_t run_id);

  /// Begins at what an earlier run left, if the first odometry message shows that it is of this
  /// boot and not too old. To be called before the first message.
  void Restore(const SavedState& state, const std::string& boot_id);

  /// Publishes POSE when there is one, LOCALIZATION, and MAP_TO_ODOM if the last one would put the
  /// body 5 mm or 1 mrad from where it is: by fixes, or by the odometry's errors that are put
  /// right. A message that is not newer than the last one, or not usable, is counted and has no
  /// effect.
  void Handle(const odometry_t& message);

  /// Puts a fix in. Publishes nothing, so that an odometry message that came meanwhile waits no
  /// longer than it must.
  void Handle(const camera_pose_t& message);

  /// Somebody says where the body is, from now on: by hand, or another system. A pose that is not
  /// usable, or one before any odometry, is counted and has no effect.
  void SetPose(const pose_t& message);

  /// Forgets the pose, and starts anew from the fixes that come.
  void Reset();

  /// Takes note of how long it took from an ODOMETRY message to its POSE, and to take in a fix.
  void NotePoseLatency(Duration latency) { pose_latency_ms_.Add(1e3 * ToSeconds(latency)); }
  void NoteFixLatency(Duration latency) { fix_latency_ms_.Add(1e3 * ToSeconds(latency)); }

  /// What the next run would need; nothing while the pose is not known.
  [[nodiscard]] std::optional<SavedState> State(const std::string& boot_id) const;

  /// In words, what became of the state given to Restore: empty before it is decided.
  [[nodiscard]] const std::string& restore_outcome() const { return restore_outcome_; }

  [[nodiscard]] NodeStatus Status(const ClockReading& now) const;

  struct Counters {
    std::int64_t odometry = 0;
    std::int64_t odometry_refused = 0;   ///< Old, repeated, or not usable.
    std::int64_t clock_jumps = 0;        ///< The odometry went on at an earlier time: began anew.
    std::int64_t odometry_bridged = 0;   ///< Messages before it were lost: X_OB tells the motion.
    std::int64_t odometry_restarts = 0;  ///< odometryd began anew: the motion is a guess.
    std::int64_t odometry_jumps = 0;     ///< A motion that no vehicle can make: likewise.
    std::int64_t camera_poses = 0;
    std::int64_t no_pose = 0;         ///< The camera says that it does not know.
    std::int64_t unknown_camera = 0;  ///< A name that the config has not.
    std::int64_t bad_pose = 0;        ///< Not finite, no unit quaternion, no covariance, tilted.
    std::int64_t poses_set = 0;       ///< By SetPose.
    std::int64_t poses_refused = 0;   ///< Likewise, but not usable.
    std::int64_t resets_asked = 0;    ///< By Reset.
    std::int64_t map_changes = 0;     ///< Fixes of another map: the estimate began anew.
    std::int64_t unpublished = 0;     ///< The network refused a message.
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }
  [[nodiscard]] const FixedLagSmoother& smoother() const { return smoother_; }

 private:
  void AddFigures(const SmootherEstimate& estimate, NodeStatus& status) const;
  /// The motion since the last odometry message.
  [[nodiscard]] bool IsOld(const odometry_t& message);
  [[nodiscard]] OdometryStep StepTo(const odometry_t& message);
  [[nodiscard]] OdometryStep Coast(MonotonicTime until) const;
  void Begin(const odometry_t& message);
  void DecideRestore(const odometry_t& message);
  [[nodiscard]] std::optional<Fix> ToFix(const camera_pose_t& message);
  void ChangeMap(const std::string& map_id);
  void StartAnew();

  void PublishPose(const odometry_t& message, const SmootherEstimate& estimate);
  void PublishLocalization(const odometry_t& message, const SmootherEstimate& estimate);
  void PublishMapToOdom(std::int64_t utime, const SmootherEstimate& estimate);
  void CountUnpublished(const Result<void>& published);
  [[nodiscard]] std::string Explain(const SmootherEstimate& estimate) const;

  LocalizationConfig config_;
  std::map<std::string, Pose3> X_BC_;
  MessageBus& bus_;
  std::int64_t run_id_;

  FixedLagSmoother smoother_;
  Counters counters_;
  std::int64_t last_old_ns_ = 0;
  int old_in_a_row_ = 0;
  LatencyWindow pose_latency_ms_;
  LatencyWindow fix_latency_ms_;
  std::optional<odometry_t> last_odometry_;
  std::optional<Pose2> published_WB_;  ///< X_WB of the last POSE, moved on by the odometry since.
  std::optional<Pose2> published_WO_;  ///< X_WO of the last MAP_TO_ODOM.
  Pose2 step_since_published_;
  std::int64_t next_seq_ = 0;
  std::int64_t last_fix_seq_ = -1;
  std::string map_id_;

  std::optional<SavedState> saved_;
  std::string boot_id_;
  std::string restore_outcome_;
};

}  // namespace relocd
