#include "smoothing/pose_history.h"

#include <algorithm>
#include <iterator>

#include "core/check.h"
#include "smoothing/motion_covariance.h"

namespace relocd {

void PoseHistory::Push(const OdometrySample& sample) {
  RELOCD_CHECK(samples_.empty() || sample.time > samples_.back().time, "time must increase");
  samples_.push_back(sample);
  // Two stay however old they are: the velocity comes from them.
  constexpr std::size_t kFewest = 2;
  while (samples_.size() > kFewest && samples_[1].time < sample.time - reach_) {
    samples_.pop_front();
  }
}

OdometrySample PoseHistory::MoveOn(const OdometrySample& before,
                                   const OdometrySample& after,
                                   double share) {
  const Pose2 X_BA = before.X_OB.Inverse() * after.X_OB;
  const Pose2 X_BS = Pose2::Exp(share * X_BA.Log());
  OdometrySample sample = before;
  sample.X_OB = before.X_OB * X_BS;
  sample.X_KB = before.X_KB * X_BS;
  sample.step_covariance = share * after.step_covariance;
  sample.covariance_KB = ComposeCovariance(before.covariance_KB, X_BS, sample.step_covariance);
  return sample;
}

std::optional<OdometrySample> PoseHistory::At(MonotonicTime time) const {
  if (samples_.empty() || time < samples_.front().time) return std::nullopt;
  const OdometrySample* const after = std::lower_bound(
      samples_.begin(), samples_.end(), time, [](const OdometrySample& sample, MonotonicTime t) {
        return sample.time < t;
      });
  if (after == samples_.end()) return Extrapolate(time);
  if (after->time == time) return *after;
  const auto before = std::prev(after);
  OdometrySample sample = MoveOn(
      *before, *after, ToSeconds(time - before->time) / ToSeconds(after->time - before->time));
  sample.time = time;
  return sample;
}

std::optional<Eigen::Vector3d> PoseHistory::VelocityAt(MonotonicTime time) const {
  constexpr double kFewestSeconds = 0.1;
  constexpr double kFastest = 200.0;
  if (samples_.empty()) return std::nullopt;
  const MonotonicTime middle = std::min(time, samples_.back().time);
  const MonotonicTime begin = std::max(middle - kVelocityReach, samples_.front().time);
  const MonotonicTime end = std::min(middle + kVelocityReach, samples_.back().time);
  const double seconds = ToSeconds(end - begin);
  if (seconds < kFewestSeconds) return std::nullopt;
  const Eigen::Vector3d velocity = (At(begin)->X_OB.Inverse() * At(end)->X_OB).Log() / seconds;
  if (!(velocity.norm() < kFastest)) return std::nullopt;
  return velocity;
}

std::optional<OdometrySample> PoseHistory::Extrapolate(MonotonicTime time) const {
  const OdometrySample& last = samples_.back();
  const Duration ahead = time - last.time;
  if (ahead > max_extrapolation_) return std::nullopt;
  OdometrySample sample = last;
  if (samples_.size() > 1) {
    const OdometrySample& before = samples_[samples_.size() - 2];
    const double share = ToSeconds(ahead) / ToSeconds(last.time - before.time);
    // The step that led to `last`, once more from `last`.
    OdometrySample next = last;
    next.X_OB = last.X_OB * (before.X_OB.Inverse() * last.X_OB);
    sample = MoveOn(last, next, share);
  }
  sample.time = time;
  sample.is_extrapolated = true;
  return sample;
}

}  // namespace relocd
