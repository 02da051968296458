#include "smoothing/offline_smoother.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "smoothing/batch_solver.h"
#include "smoothing/chain_solver.h"
#include "smoothing/consensus.h"
#include "smoothing/fix_misfit.h"
#include "smoothing/keyframe_window.h"
#include "smoothing/motion_covariance.h"
#include "smoothing/pose_history.h"

namespace relocd {
namespace {

constexpr int kBatchIterations = 200;

/// Feeds a log to a smoother in the order of time, and calls `after_fix` after each fix.
template <typename AfterFix>
void Feed(const MotionLog& log, FixedLagSmoother& smoother, AfterFix after_fix) {
  std::size_t step = 0;
  const auto feed_odometry = [&](MonotonicTime until) {
    for (; step < log.odometry.size() && log.odometry[step].time <= until; ++step) {
      static_cast<void>(smoother.AddOdometry(log.odometry[step]));  // the smoother counts refusals
    }
  };
  for (const Fix& fix : log.fixes) {
    feed_odometry(fix.time);
    smoother.AddFix(fix);
    after_fix(fix);
  }
  // One more, to interpolate at the last fix; what comes later tells nothing of the fixes' times.
  if (step < log.odometry.size()) feed_odometry(log.odometry[step].time);
}

/// All keyframes of a log, first as the fixed-lag smoother left them.
KeyframeWindow CollectKeyframes(const MotionLog& log, const SmootherConfig& config) {
  FixedLagSmoother smoother(config);
  KeyframeWindow all;
  smoother.OnLeave([&](const Keyframe& keyframe, std::span<const AttachedFix> fixes) {
    all.keyframes.push_back(keyframe);
    std::copy(fixes.begin(), fixes.end(), std::back_inserter(all.fixes));
  });
  Feed(log, smoother, [](const Fix&) {});
  for (const Keyframe& keyframe : smoother.window().keyframes)
    all.keyframes.push_back(keyframe);
  const auto& fixes = smoother.window().fixes;
  std::copy(fixes.begin(), fixes.end(), std::back_inserter(all.fixes));
  all.systematic = SystematicErrorsOf(config);
  all.SetSystematicErrors(smoother.systematic_errors().estimate);
  return all;
}

/// Makes the estimates of what left the window before a new start follow it, up to the next cut.
void FollowNewStarts(KeyframeWindow& all) {
  for (std::size_t i = all.keyframes.size(); i-- > 1;) {
    const Keyframe& after = all.keyframes[i];
    Keyframe& before = all.keyframes[i - 1];
    if (after.is_cut || before.generation == after.generation) continue;
    before.SetX_WK(after.X_WK() * after.X_PK.Inverse());
    before.generation = after.generation;
  }
}

/// How many fixes each stretch between cuts has near its estimates.
std::vector<int> SupportersOfStretches(const KeyframeWindow& all, const ConsensusOptions& options) {
  std::vector<int> supporters;
  std::size_t next_fix = 0;
  for (const Keyframe& keyframe : all.keyframes) {
    if (supporters.empty() || keyframe.is_cut) supporters.push_back(0);
    for (; next_fix < all.fixes.size() && all.fixes[next_fix].keyframe_id <= keyframe.id;
         ++next_fix) {
      const ConsensusFix fix = ToConsensusFix(all.fixes[next_fix].fix, Pose2());
      if (Supports(fix, all.X_WF(all.fixes[next_fix]), options)) ++supporters.back();
    }
  }
  return supporters;
}

std::vector<Eigen::Vector3d> TakeEstimates(const KeyframeWindow& all) {
  std::vector<Eigen::Vector3d> estimates;
  for (const Keyframe& keyframe : all.keyframes)
    estimates.push_back(keyframe.x_WK);
  return estimates;
}

void PutEstimates(const std::vector<Eigen::Vector3d>& estimates, KeyframeWindow& all) {
  for (std::size_t i = 0; i < estimates.size(); ++i)
    all.keyframes[i].x_WK = estimates[i];
}

/// Solves over all keyframes. Where the smoother cut the chain because the body seemed to have been
/// carried, the whole log knows better: the motion is believed unless a stretch then loses most of
/// the fixes that support it.
void SolveAll(const FixWeighting& weighting, const ConsensusOptions& options, KeyframeWindow& all) {
  constexpr double kCarriedFactor = 1e7;
  FollowNewStarts(all);
  const bool has_cuts = std::any_of(
      all.keyframes.begin(), all.keyframes.end(), [](const Keyframe& k) { return k.is_cut; });
  if (!has_cuts) {
    SolveBatch(all, weighting, kBatchIterations);
    return;
  }
  for (Keyframe& keyframe : all.keyframes) {
    if (keyframe.is_cut) keyframe.covariance_PK *= kCarriedFactor;
  }
  SolveBatch(all, weighting, kBatchIterations);
  const std::vector<int> with_cuts = SupportersOfStretches(all, options);
  const std::vector<Eigen::Vector3d> estimates = TakeEstimates(all);

  for (Keyframe& keyframe : all.keyframes) {
    if (keyframe.is_cut) keyframe.covariance_PK *= 1.0 / kCarriedFactor;
  }
  for (std::size_t i = all.keyframes.size(); i-- > 1;) {
    const Keyframe& after = all.keyframes[i];
    all.keyframes[i - 1].SetX_WK(after.X_WK() * after.X_PK.Inverse());
  }
  SolveBatch(all, weighting, kBatchIterations);
  const std::vector<int> joined = SupportersOfStretches(all, options);
  bool is_carried = false;
  for (std::size_t i = 0; i < joined.size(); ++i) {
    is_carried = is_carried || 2 * joined[i] < with_cuts[i];
  }
  if (!is_carried) return;
  PutEstimates(estimates, all);
  for (Keyframe& keyframe : all.keyframes) {
    if (keyframe.is_cut) keyframe.covariance_PK *= kCarriedFactor;
  }
}

/// The odometry of a log between its keyframes, for looking up where a fix was.
class OdometryLookup {
 public:
  OdometryLookup(const MotionLog& log, const KeyframeWindow& all, const SmootherConfig& config)
      : history_(Duration::max() / 2, FromSeconds(config.max_extrapolation_s)) {
    std::size_t next_keyframe = 0;
    OdometrySample sample;
    for (const OdometryStep& step : log.odometry) {
      if (!history_.empty() && step.time <= sample.time) continue;
      if (!history_.empty()) Move(step, config.odometry_covariance_factor, sample);
      sample.time = step.time;
      if (next_keyframe < all.keyframes.size() &&
          all.keyframes[next_keyframe].time == sample.time) {
        sample.keyframe_id = all.keyframes[next_keyframe].id;
        sample.X_KB = Pose2();
        sample.covariance_KB.setZero();
        ++next_keyframe;
      }
      history_.Push(sample);
    }
  }

  [[nodiscard]] std::optional<OdometrySample> At(MonotonicTime time) const {
    return history_.At(time);
  }

 private:
  static void Move(const OdometryStep& step, double factor, OdometrySample& sample) {
    sample.X_OB = sample.X_OB * step.X_BprevB;
    sample.X_KB = sample.X_KB * step.X_BprevB;
    sample.step_covariance = factor * step.covariance;
    sample.covariance_KB =
        ComposeCovariance(sample.covariance_KB, step.X_BprevB, sample.step_covariance);
  }

  PoseHistory history_;
};

}  // namespace

OdometryStep MakeOdometryStep(MonotonicTime time,
                              Duration duration,
                              const Pose2& motion,
                              const OdometryNoiseConfig& noise) {
  const auto variance = [](double sigma_per_root, double amount) {
    return sigma_per_root * sigma_per_root * amount;
  };
  const double travel = motion.translation().norm();
  const double turn = std::abs(motion.yaw());
  const double seconds = ToSeconds(duration);
  const double at_rest = variance(noise.position_sigma_m_per_sqrt_s, seconds);
  OdometryStep step;
  step.time = time;
  step.X_BprevB = motion;
  step.covariance.diagonal() << at_rest + variance(noise.forward_sigma_m_per_sqrt_m, travel),
      at_rest + variance(noise.sideways_sigma_m_per_sqrt_m, travel),
      variance(noise.heading_sigma_rad_per_sqrt_s, seconds) +
          variance(noise.heading_sigma_rad_per_sqrt_m, travel) +
          variance(noise.heading_sigma_rad_per_sqrt_rad, turn);
  return step;
}

Fix MakePositionFix(MonotonicTime time, const Eigen::Vector2d& p_WB, const SmootherConfig& config) {
  Fix fix = MakePoseFix(time, Pose2(p_WB.x(), p_WB.y(), 0.0), config);
  fix.has_heading = false;
  return fix;
}

Fix MakePoseFix(MonotonicTime time, const Pose2& X_WB, const SmootherConfig& config) {
  Fix fix;
  fix.time = time;
  fix.X_WB = X_WB;
  const Eigen::Vector3d sigmas(
      config.default_fix_sigma_m, config.default_fix_sigma_m, config.default_fix_heading_sigma_rad);
  fix.covariance = sigmas.cwiseAbs2().asDiagonal();
  return fix;
}

std::vector<SmootherEstimate> SmoothCausally(const MotionLog& log,
                                             const SmootherConfig& config,
                                             SystematicErrors* errors) {
  FixedLagSmoother smoother(config);
  std::vector<SmootherEstimate> estimates;
  estimates.reserve(log.fixes.size());
  Feed(log, smoother, [&](const Fix& fix) {
    SmootherEstimate none;
    none.time = fix.time;
    estimates.push_back(smoother.EstimateAt(fix.time).value_or(none));
  });
  if (errors != nullptr) *errors = smoother.systematic_errors();
  return estimates;
}

std::vector<SmootherEstimate> SmoothAll(const MotionLog& log,
                                        const SmootherConfig& config,
                                        SystematicErrors* errors) {
  if (errors != nullptr) *errors = SystematicErrorsOf(config);
  std::vector<SmootherEstimate> estimates(log.fixes.size());
  for (std::size_t i = 0; i < estimates.size(); ++i)
    estimates[i].time = log.fixes[i].time;
  KeyframeWindow all = CollectKeyframes(log, config);
  const bool is_started = !all.keyframes.empty() && all.keyframes.back().generation > 0;
  if (!is_started) return estimates;
  for (AttachedFix& fix : all.fixes)
    fix.is_gated = false;
  UpdateAllShares(all, config.fix_correlation_time_s);
  FixWeighting weighting = WeightingOf(config);
  const ConsensusOptions consensus_options{.radius_sigmas = config.relocalization_radius_sigmas,
                                           .min_radius_m = config.relocalization_min_radius_m};
  FixMisfit misfit;
  weighting.SetMisfit(misfit.Measure(all, weighting).misfit);
  SolveAll(weighting, consensus_options, all);
  // The whole log's own errors, from estimates that are near enough to the best ones.
  const FixErrors fix_errors = misfit.Measure(all, weighting);
  weighting.SetMisfit(fix_errors.misfit);
  weighting.SetScatter(fix_errors.scatter);
  SolveBatch(all, weighting, kBatchIterations);
  const std::vector<Eigen::Matrix3d> covariances =
      ChainSolver(all.keyframes.size()).SmoothedCovariances(all, weighting);
  if (errors != nullptr) *errors = all.systematic;
  const OdometryLookup odometry(log, all, config);
  for (SmootherEstimate& estimate : estimates) {
    const auto sample = odometry.At(estimate.time);
    if (!sample) continue;
    const auto index = static_cast<std::size_t>(sample->keyframe_id - all.keyframes.front().id);
    estimate.has_pose = true;
    estimate.X_WB = all.keyframes[index].X_WK() * sample->X_KB;
    estimate.covariance =
        ComposeCovariance(covariances[index], sample->X_KB, sample->covariance_KB);
    estimate.status =
        IsCertain(estimate.covariance, config) ? SmootherStatus::kOk : SmootherStatus::kConverging;
  }
  return estimates;
}

}  // namespace relocd
