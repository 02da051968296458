#include "smootherd/smoother_node.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "relocd/pose_t.hpp"
#include "relocd/rigid_transform_t.hpp"

#include "geometry/covariance.h"
#include "geometry/planar.h"
#include "smoothing/motion_covariance.h"
#include "smoothing/offline_smoother.h"

namespace relocd {
namespace {

/// A wheel that slips errs by a share of its travel: the sigma grows this many times.
constexpr double kSlipFactor = 25.0;
/// Measurements are missing in the interval: odometryd bridged it.
constexpr double kGapFactor = 4.0;
/// What a body does that is not watched: it keeps its velocity to within these.
constexpr double kAccelerationSigma = 2.0;         // m/s^2
constexpr double kAngularAccelerationSigma = 1.0;  // rad/s^2
/// For longer than this it does not even do that.
constexpr double kLongestCoast = 1.0;  // s
/// A body more tilted than this has no heading on the map: the camera pose must be wrong.
constexpr double kLeastUprightness = 0.5;  // the cosine of 60 degrees
/// MAP_TO_ODOM is published when the last one would put the body this far from where it is: the
/// odometry's constant errors, which are put right in the pose, turn it slowly all the time.
constexpr double kLeastMove = 5e-3;  // m
constexpr double kLeastTurn = 1e-3;  // rad
/// So many messages in a row that are older than the newest one, but rise: the clock has jumped
/// back.
constexpr int kOldAreNew = 100;
/// No odometry for so long is a fault.
constexpr double kOdometryTimeout = 1.0;  // s
/// How well somebody who sets a pose knows it: to the side of the road, and a quarter of a right
/// angle.
constexpr double kSetSigma = 2.0;         // m
constexpr double kSetHeadingSigma = 0.2;  // rad
/// No vehicle moves faster, nor farther in no time.
constexpr double kFastest = 200.0;  // m/s
constexpr double kJitter = 1.0;     // m
/// In metres, rad and seconds: beyond it is no measurement of a vehicle on the Earth.
constexpr double kLargestNumber = 1e8;
constexpr double kUnknownYawVariance = std::numbers::pi * std::numbers::pi / 3.0;

Pose2 X_OBOf(const odometry_t& message) {
  return {message.x_OB_m, message.y_OB_m, message.yaw_OB_rad};
}

/// Whether it is finite, and stays so when it is squared and added up.
bool IsSane(double number) {
  return std::abs(number) <= kLargestNumber;
}

/// Whether differences of it with others do not overflow.
bool IsSaneTime(std::int64_t mono_ns) {
  constexpr std::int64_t kLatest = std::numeric_limits<std::int64_t>::max() / 4;
  return mono_ns >= -kLatest && mono_ns <= kLatest;
}

bool IsSane(const odometry_t& message) {
  const std::array numbers{message.dx_m,
                           message.dy_m,
                           message.dtheta_rad,
                           message.x_OB_m,
                           message.y_OB_m,
                           message.yaw_OB_rad,
                           message.speed_mps,
                           message.yaw_rate_radps};
  return IsSaneTime(message.mono_ns) && IsSaneTime(message.prev_mono_ns) &&
         std::ranges::all_of(numbers, [](double number) { return IsSane(number); });
}

Eigen::Matrix3d CovarianceOf(const odometry_t& message) {
  return Eigen::Map<const Eigen::Matrix3d>(message.motion_covariance);  // symmetric
}

/// The sigma of a motion of unknown acceleration, at most what the body can do.
double CoastSigma(double speed, double acceleration, double seconds, double largest_speed) {
  const double drifted = 0.5 * std::abs(speed) * seconds + 0.5 * acceleration * seconds * seconds;
  return std::min(drifted, largest_speed * seconds);
}

}  // namespace

SmootherNode::SmootherNode(const LocalizationConfig& config,
                           std::map<std::string, Pose3> X_BC,
                           MessageBus& bus,
                           std::int64_t run_id)
    : config_(config),
      X_BC_(std::move(X_BC)),
      bus_(bus),
      run_id_(run_id),
      smoother_(config.smoother) {}

void SmootherNode::Restore(const SavedState& state, const std::string& boot_id) {
  saved_ = state;
  boot_id_ = boot_id;
}

void SmootherNode::Handle(const odometry_t& message) {
  ++counters_.odometry;
  if (!IsSane(message) || IsOld(message)) {
    ++counters_.odometry_refused;
    return;
  }
  if (!last_odometry_) {
    Begin(message);
  } else {
    const OdometryStep step = StepTo(message);
    if (!smoother_.AddOdometry(step)) {
      ++counters_.odometry_refused;
      return;
    }
    step_since_published_ = smoother_.newest_motion();
  }
  last_odometry_ = message;
  const SmootherEstimate estimate = smoother_.Estimate();
  PublishPose(message, estimate);
  PublishLocalization(message, estimate);
  PublishMapToOdom(message.utime, estimate);
}

bool SmootherNode::IsOld(const odometry_t& message) {
  if (!last_odometry_ || message.mono_ns > last_odometry_->mono_ns) {
    old_in_a_row_ = 0;
    return false;
  }
  old_in_a_row_ = message.mono_ns > last_old_ns_ ? old_in_a_row_ + 1 : 1;
  last_old_ns_ = message.mono_ns;
  if (old_in_a_row_ < kOldAreNew) return true;
  // The newest one was of a wrong time, or all are of another clock: else none would ever be used.
  ++counters_.clock_jumps;
  old_in_a_row_ = 0;
  last_odometry_.reset();
  StartAnew();
  return false;
}

OdometryStep SmootherNode::StepTo(const odometry_t& message) {
  const MonotonicTime time = FromNanoseconds(message.mono_ns);
  if (message.run_id != last_odometry_->run_id) {
    ++counters_.odometry_restarts;
    return Coast(time);
  }
  OdometryStep step;
  step.time = time;
  step.X_BprevB = Pose2(message.dx_m, message.dy_m, message.dtheta_rad);
  step.covariance = CovarianceOf(message);
  if (message.prev_mono_ns != last_odometry_->mono_ns) {
    ++counters_.odometry_bridged;
    const auto gap = static_cast<double>(message.mono_ns - last_odometry_->mono_ns);
    const auto interval = static_cast<double>(message.mono_ns - message.prev_mono_ns);
    step.X_BprevB = X_OBOf(*last_odometry_).Inverse() * X_OBOf(message);
    step.covariance *= interval > 0.0 ? std::max(1.0, gap / interval) : 1.0;
    // The motions in between may have been of another kind than this one.
    step.covariance +=
        MakeOdometryStep(
            time, FromSeconds(gap * 1e-9), step.X_BprevB, config_.smoother.default_odometry_noise)
            .covariance;
  }
  const auto has_flag = [&message](std::int32_t flag) { return (message.flags & flag) != 0; };
  if (has_flag(odometry_t::FLAG_SLIP)) step.covariance *= kSlipFactor;
  if (has_flag(odometry_t::FLAG_GAP) || has_flag(odometry_t::FLAG_JUMP)) {
    step.covariance *= kGapFactor;
  }
  if (has_flag(odometry_t::FLAG_STALE)) step.covariance += Coast(time).covariance;
  const double seconds = ToSeconds(time - FromNanoseconds(last_odometry_->mono_ns));
  if (step.X_BprevB.translation().norm() > kJitter + kFastest * seconds) {
    ++counters_.odometry_jumps;
    return Coast(time);
  }
  return step;
}

OdometryStep SmootherNode::Coast(MonotonicTime until) const {
  const double seconds = ToSeconds(until - FromNanoseconds(last_odometry_->mono_ns));
  const double coasted = std::min(seconds, kLongestCoast);
  const double speed = last_odometry_->speed_mps;
  const double yaw_rate = last_odometry_->yaw_rate_radps;
  OdometryStep step;
  step.time = until;
  step.X_BprevB = Pose2::Exp({speed * coasted, 0.0, yaw_rate * coasted});
  const double position_sigma =
      CoastSigma(speed, kAccelerationSigma, seconds, config_.max_speed_mps);
  const double yaw_sigma =
      CoastSigma(yaw_rate, kAngularAccelerationSigma, seconds, config_.max_yaw_rate_radps);
  step.covariance.diagonal() << position_sigma * position_sigma, position_sigma * position_sigma,
      std::min(yaw_sigma * yaw_sigma, kUnknownYawVariance);
  return step;
}

void SmootherNode::Begin(const odometry_t& message) {
  OdometryStep first;
  first.time = FromNanoseconds(message.mono_ns);
  // The first step only sets the time, and cannot be refused.
  static_cast<void>(smoother_.AddOdometry(first).has_value());
  step_since_published_ = Pose2();
  if (saved_) DecideRestore(message);
}

void SmootherNode::DecideRestore(const odometry_t& message) {
  const SavedState state = *std::exchange(saved_, std::nullopt);
  const double age_s = ToSeconds(FromNanoseconds(message.mono_ns) - state.time);
  if (state.boot_id != boot_id_) {
    restore_outcome_ = "the saved pose is of an earlier boot: not used";
    return;
  }
  if (!(age_s >= 0.0 && age_s <= config_.state_max_age_s)) {
    restore_outcome_ = fmt::format("the saved pose is {:.1f} s old, must be in [0, {}] s: not used",
                                   age_s,
                                   config_.state_max_age_s);
    return;
  }
  PlanarPose prior{.X_WB = state.X_WB, .covariance = state.covariance};
  if (state.odometry_run_id == message.run_id) {
    // The odometry went on meanwhile: the motion since then is known.
    const Pose2 motion = state.X_OB.Inverse() * X_OBOf(message);
    const OdometryStep step = MakeOdometryStep(FromNanoseconds(message.mono_ns),
                                               FromSeconds(age_s),
                                               motion,
                                               config_.smoother.default_odometry_noise);
    prior.X_WB = state.X_WB * motion;
    prior.covariance = ComposeCovariance(state.covariance, motion, step.covariance);
    restore_outcome_ = fmt::format("continues from the saved pose, {:.1f} s old", age_s);
  } else {
    const double reach = config_.max_speed_mps * age_s;
    const double turn = config_.max_yaw_rate_radps * age_s;
    prior.covariance.diagonal() += Eigen::Vector3d(
        reach * reach / 3.0, reach * reach / 3.0, std::min(turn * turn / 3.0, kUnknownYawVariance));
    restore_outcome_ = fmt::format(
        "begins at the saved pose, {:.1f} s old, of an earlier run of odometryd", age_s);
  }
  if (auto ok = smoother_.Reset(prior); !ok) {
    restore_outcome_ = std::move(ok).error().message;
    return;
  }
  map_id_ = state.map_id;
}

void SmootherNode::Handle(const camera_pose_t& message) {
  ++counters_.camera_poses;
  if (message.status != camera_pose_t::STATUS_OK) {
    ++counters_.no_pose;
    return;
  }
  const auto fix = ToFix(message);
  if (!fix) return;
  if (message.map_id != map_id_) ChangeMap(message.map_id);
  const FixOutcome outcome = smoother_.AddFix(*fix);
  if (outcome == FixOutcome::kAccepted || outcome == FixOutcome::kRedundant) {
    last_fix_seq_ = message.seq;
  }
}

std::optional<Fix> SmootherNode::ToFix(const camera_pose_t& message) {
  const auto camera = X_BC_.find(message.camera);
  if (camera == X_BC_.end()) {
    ++counters_.unknown_camera;
    return std::nullopt;
  }
  const Eigen::Quaterniond rotation(
      message.quat[0], message.quat[1], message.quat[2], message.quat[3]);
  const Eigen::Vector3d translation(message.pos[0], message.pos[1], message.pos[2]);
  const Matrix6d covariance_WC = Eigen::Map<const Matrix6d>(message.covariance);  // symmetric
  constexpr double kUnitTolerance = 1e-3;
  const bool is_unit = std::abs(rotation.norm() - 1.0) < kUnitTolerance;
  const bool is_somewhere = std::ranges::all_of(message.pos, [](double p) { return IsSane(p); });
  if (!is_unit || !is_somewhere || !IsSaneTime(message.mono_ns) || !IsCovariance(covariance_WC)) {
    ++counters_.bad_pose;
    return std::nullopt;
  }
  const Pose3& X_BC = camera->second;
  const Pose3 X_WB = Pose3(rotation, translation) * X_BC.Inverse();
  if (X_WB.R()(2, 2) < kLeastUprightness) {
    ++counters_.bad_pose;
    return std::nullopt;
  }
  const PlanarPose planar = ProjectToPlane(X_WB, TransportCovariance(covariance_WC, X_BC));
  return Fix{.time = FromNanoseconds(message.mono_ns),
             .X_WB = planar.X_WB,
             .has_heading = true,
             .covariance = planar.covariance,
             .p_BC = X_BC.translation().head<2>()};
}

void SmootherNode::ChangeMap(const std::string& map_id) {
  const bool is_first = map_id_.empty();
  map_id_ = map_id;
  if (is_first) return;
  // Poses of another map are of another W.
  ++counters_.map_changes;
  published_WB_.reset();
  StartAnew();
}

void SmootherNode::StartAnew() {
  smoother_.Forget();
  if (!last_odometry_) return;
  OdometryStep first;
  first.time = FromNanoseconds(last_odometry_->mono_ns);
  static_cast<void>(smoother_.AddOdometry(first).has_value());
}

void SmootherNode::Reset() {
  ++counters_.resets_asked;
  saved_.reset();
  StartAnew();
}

void SmootherNode::SetPose(const pose_t& message) {
  const double* const q = message.orientation;
  const double w = std::hypot(q[0], q[3]);
  // Turned about the vertical alone, which is all that a pose in the plane can be.
  const bool is_planar = std::abs(w - 1.0) < 1e-3 && std::hypot(q[1], q[2]) < 1e-3;
  PlanarPose prior{.X_WB = Pose2(message.pos[0], message.pos[1], 2.0 * std::atan2(q[3], q[0]))};
  prior.covariance.diagonal() << kSetSigma * kSetSigma, kSetSigma * kSetSigma,
      kSetHeadingSigma * kSetHeadingSigma;
  const bool is_somewhere = IsSane(message.pos[0]) && IsSane(message.pos[1]);
  if (!last_odometry_ || !is_planar || !is_somewhere || !smoother_.Reset(prior)) {
    ++counters_.poses_refused;
    return;
  }
  ++counters_.poses_set;
  saved_.reset();
  PublishMapToOdom(last_odometry_->utime, smoother_.Estimate());
}

void SmootherNode::PublishPose(const odometry_t& message, const SmootherEstimate& estimate) {
  // A pose_t has no status: without a heading there is none that a controller could use.
  if (estimate.status == SmootherStatus::kUninitialised) return;
  pose_t pose{};
  pose.utime = message.utime;
  pose.pos[0] = estimate.X_WB.x();
  pose.pos[1] = estimate.X_WB.y();
  pose.vel[0] = message.speed_mps;
  pose.orientation[0] = std::cos(0.5 * estimate.X_WB.yaw());
  pose.orientation[3] = std::sin(0.5 * estimate.X_WB.yaw());
  pose.rotation_rate[2] = message.yaw_rate_radps;
  CountUnpublished(bus_.Publish(channels::kPose, pose));
}

void SmootherNode::PublishLocalization(const odometry_t& message,
                                       const SmootherEstimate& estimate) {
  localization_t answer{};
  answer.utime = message.utime;
  answer.mono_ns = message.mono_ns;
  answer.seq = next_seq_++;
  answer.run_id = run_id_;
  answer.status = static_cast<std::int32_t>(estimate.status);
  answer.message = Explain(estimate);
  answer.speed_mps = message.speed_mps;
  answer.yaw_rate_radps = message.yaw_rate_radps;
  answer.time_since_fix_s = estimate.time_since_fix_s.value_or(-1.0);
  answer.distance_since_fix_m = estimate.distance_since_fix_m;
  // Also while there is no pose: the next one may be elsewhere.
  if (published_WB_) published_WB_ = *published_WB_ * step_since_published_;
  if (estimate.status != SmootherStatus::kUninitialised) {
    answer.x_WB_m = estimate.X_WB.x();
    answer.y_WB_m = estimate.X_WB.y();
    answer.yaw_WB_rad = estimate.X_WB.yaw();
    Eigen::Map<Eigen::Matrix3d>(answer.covariance) = estimate.covariance;  // symmetric
    if (published_WB_) {
      const Pose2 jump = published_WB_->Inverse() * estimate.X_WB;
      answer.jump_m = jump.translation().norm();
      answer.jump_rad = std::abs(jump.yaw());
    }
    published_WB_ = estimate.X_WB;
  }
  const SmootherCounters& counters = smoother_.counters();
  answer.fixes_accepted = counters.fixes_accepted + counters.fixes_redundant;
  answer.fixes_rejected = counters.fixes_gated + counters.fixes_invalid + counters.fixes_ahead +
                          counters_.bad_pose + counters_.unknown_camera;
  answer.fixes_late = counters.fixes_late;
  answer.resets = counters.relocalizations + counters_.map_changes + counters_.clock_jumps +
                  counters_.poses_set + counters_.resets_asked;
  answer.odometry_seq = message.seq;
  answer.odometry_run_id = message.run_id;
  answer.last_fix_seq = last_fix_seq_;
  answer.map_id = map_id_;
  CountUnpublished(bus_.Publish(channels::kLocalization, answer));
}

void SmootherNode::PublishMapToOdom(std::int64_t utime, const SmootherEstimate& estimate) {
  if (estimate.status == SmootherStatus::kUninitialised) return;
  const Pose2 X_WO = estimate.X_WB * X_OBOf(*last_odometry_).Inverse();
  if (published_WO_) {
    const Pose2 move = (*published_WO_ * X_OBOf(*last_odometry_)).Inverse() * estimate.X_WB;
    if (move.translation().norm() <= kLeastMove && std::abs(move.yaw()) <= kLeastTurn) return;
  }
  published_WO_ = X_WO;
  rigid_transform_t transform{};
  transform.utime = utime;
  transform.trans[0] = X_WO.x();
  transform.trans[1] = X_WO.y();
  transform.quat[0] = std::cos(0.5 * X_WO.yaw());
  transform.quat[3] = std::sin(0.5 * X_WO.yaw());
  CountUnpublished(bus_.Publish(channels::kMapToOdom, transform));
}

void SmootherNode::CountUnpublished(const Result<void>& published) {
  if (!published) ++counters_.unpublished;
}

std::string SmootherNode::Explain(const SmootherEstimate& estimate) const {
  const Eigen::Vector3d sigmas = estimate.covariance.diagonal().cwiseSqrt();
  switch (estimate.status) {
    case SmootherStatus::kUninitialised:
      return estimate.has_pose ? fmt::format("{} fixes do not agree on a pose yet",
                                             smoother_.window().fixes.size())
                               : "no fix yet";
    case SmootherStatus::kConverging:
      return fmt::format("sigma {:.2f} m, {:.2f} m, {:.3f} rad, or few fixes support the pose",
                         sigmas.x(),
                         sigmas.y(),
                         sigmas.z());
    case SmootherStatus::kOk:
      return "";
    case SmootherStatus::kDeadReckoning:
      return estimate.time_since_fix_s ? fmt::format("no fix for {:.1f} s, {:.1f} m",
                                                     *estimate.time_since_fix_s,
                                                     estimate.distance_since_fix_m)
                                       : "no fix since the start, from a saved pose";
    case SmootherStatus::kLost:
      return "the last fixes contradict the pose";
  }
  return "";
}

std::optional<SavedState> SmootherNode::State(const std::string& boot_id) const {
  if (!last_odometry_) return std::nullopt;
  const SmootherEstimate estimate = smoother_.Estimate();
  if (estimate.status == SmootherStatus::kUninitialised ||
      estimate.status == SmootherStatus::kLost) {
    return std::nullopt;
  }
  return SavedState{.boot_id = boot_id,
                    .time = FromNanoseconds(last_odometry_->mono_ns),
                    .odometry_run_id = last_odometry_->run_id,
                    .map_id = map_id_,
                    .X_WB = estimate.X_WB,
                    .X_OB = X_OBOf(*last_odometry_),
                    .covariance = estimate.covariance};
}

void SmootherNode::AddFigures(const SmootherEstimate& estimate, NodeStatus& status) const {
  const auto add = [&status](const char* name, std::int64_t value) {
    status.Add(name, static_cast<double>(value));
  };
  const SmootherCounters& counters = smoother_.counters();
  add("status", static_cast<std::int64_t>(estimate.status));
  add("odometry", counters_.odometry);
  add("odometry_refused", counters_.odometry_refused);
  add("clock_jumps", counters_.clock_jumps);
  add("odometry_bridged", counters_.odometry_bridged);
  add("odometry_restarts", counters_.odometry_restarts);
  add("odometry_jumps", counters_.odometry_jumps);
  add("camera_poses", counters_.camera_poses);
  add("camera_poses_without_pose", counters_.no_pose);
  add("camera_poses_of_unknown_camera", counters_.unknown_camera);
  add("camera_poses_bad", counters_.bad_pose);
  add("fixes_accepted", counters.fixes_accepted);
  add("fixes_redundant", counters.fixes_redundant);
  add("fixes_gated", counters.fixes_gated);
  add("fixes_late", counters.fixes_late);
  add("fixes_ahead", counters.fixes_ahead);
  add("fixes_invalid", counters.fixes_invalid);
  add("relocalizations", counters.relocalizations);
  add("map_changes", counters_.map_changes);
  add("poses_set", counters_.poses_set);
  add("poses_refused", counters_.poses_refused);
  add("resets_asked", counters_.resets_asked);
  add("solver_failures", counters.solver_failures);
  add("unpublished", counters_.unpublished);
  add("window_keyframes", static_cast<std::int64_t>(smoother_.window().keyframes.size()));
  add("window_fixes", static_cast<std::int64_t>(smoother_.window().fixes.size()));
  status.Add("odometry_to_pose_p50_ms", pose_latency_ms_.Percentile(0.5));
  status.Add("odometry_to_pose_p99_ms", pose_latency_ms_.Percentile(0.99));
  status.Add("fix_p50_ms", fix_latency_ms_.Percentile(0.5));
  status.Add("fix_p99_ms", fix_latency_ms_.Percentile(0.99));
  const SystematicErrors& errors = smoother_.systematic_errors();
  status.Add("odometry_drift_rad_per_m", errors.odometry_rad_per_m());
  status.Add("odometry_yaw_rate_bias_rad_per_s", errors.odometry_rad_per_s());
  status.Add("odometry_scale", errors.odometry_scale());
  if (errors.IsCameraSought()) {
    status.Add("camera_yaw_rad", errors.camera_yaw_rad());
    status.Add("camera_yaw_sigma_rad", errors.Sigmas()[0]);
    status.Add("camera_time_s", errors.camera_time_s());
    status.Add("camera_time_sigma_s", errors.Sigmas()[1]);
  }
  status.Add("fix_misfit", smoother_.weighting().misfit());
  status.Add("time_since_fix_s", estimate.time_since_fix_s.value_or(-1.0));
  status.Add("position_sigma_m",
             std::sqrt(0.5 * estimate.covariance.topLeftCorner<2, 2>().trace()));
}

NodeStatus SmootherNode::Status(const ClockReading& now) const {
  NodeStatus status;
  const SmootherEstimate estimate = smoother_.Estimate();
  AddFigures(estimate, status);
  if (!last_odometry_) {
    status.Raise(status_t::ERROR, "no odometry since the start");
    return status;
  }
  const double silence_s = ToSeconds(now.monotonic - FromNanoseconds(last_odometry_->mono_ns));
  if (silence_s > kOdometryTimeout) {
    status.Raise(status_t::ERROR, fmt::format("no odometry for {:.1f} s", silence_s));
  }
  if (counters_.unknown_camera > 0) {
    status.Raise(status_t::WARNING,
                 fmt::format("{} camera poses are of a camera that the config has not",
                             counters_.unknown_camera));
  }
  if (estimate.status != SmootherStatus::kOk) {
    status.Raise(status_t::WARNING,
                 fmt::format("{}: {}", ToString(estimate.status), Explain(estimate)));
  }
  return status;
}

}  // namespace relocd
