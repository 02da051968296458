#include "smoothing/odometry_break.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "core/time.h"

namespace relocd {
namespace {

/// So many fixes more than three for each that supports the estimates must contradict them: with
/// fewer, robots that nobody had carried were moved.
constexpr int kFewest = 8;
constexpr int kForEach = 3;
/// And such a part of all since the break must agree.
constexpr double kShare = 0.6;
/// Errors of neighbours are alike: fixes of less time than this are not enough, however many.
constexpr Duration kShortest = std::chrono::seconds(1);
/// The newest fixes among which those are looked for.
constexpr std::size_t kMostFixes = 60;
/// A body whose heading is less certain than this would go on to the wrong side.
constexpr double kHeadingSigma = 0.5;

ConsensusFix AsConsensus(const KeyframeWindow& window, const AttachedFix& fix) {
  return ToConsensusFix(fix.fix, window.Get(fix.keyframe_id).X_OB * fix.X_KF);
}

bool SupportsEstimate(const KeyframeWindow& window,
                      const AttachedFix& fix,
                      const ConsensusOptions& options) {
  return Supports(AsConsensus(window, fix), window.X_WF(fix), options);
}

bool SupportsWith(const KeyframeWindow& window,
                  const AttachedFix& fix,
                  const Pose2& X_WO,
                  const ConsensusOptions& options) {
  const ConsensusFix as_consensus = AsConsensus(window, fix);
  return Supports(as_consensus, X_WO * as_consensus.X_OB, options);
}

/// The first of the newest fixes of which enough contradict the estimates; the end where they do
/// not.
const AttachedFix* FirstContradictor(const KeyframeWindow& window,
                                     const ConsensusOptions& options) {
  const AttachedFix* first = window.fixes.end();
  int missing = kFewest;
  std::size_t count = std::min(window.fixes.size(), kMostFixes);
  for (const AttachedFix* fix = window.fixes.end(); count-- > 0;) {
    --fix;
    missing += SupportsEstimate(window, *fix, options) ? kForEach : -1;
    if (missing > 2 * kFewest) break;
    if (missing <= 0) first = fix;
  }
  return first;
}

/// The first of the newest fixes that support X_WO and not the estimates, where enough do so since
/// then.
const AttachedFix* FirstSupporter(const KeyframeWindow& window,
                                  const Pose2& X_WO,
                                  const ConsensusOptions& options) {
  const AttachedFix* first = nullptr;
  int supporters = 0;
  int contradictors = 0;
  int best_balance = 0;
  bool is_enough = false;
  const auto count = static_cast<int>(std::min(window.fixes.size(), kMostFixes));
  for (int i = 1; i <= count; ++i) {
    const AttachedFix& fix = *(window.fixes.end() - i);
    if (SupportsEstimate(window, fix, options)) {
      ++contradictors;
      continue;
    }
    if (!SupportsWith(window, fix, X_WO, options)) continue;
    ++supporters;
    if (supporters - contradictors < best_balance) continue;
    best_balance = supporters - contradictors;
    first = &fix;
    is_enough = supporters >= kFewest + kForEach * contradictors && supporters >= kShare * i;
  }
  return is_enough ? first : nullptr;
}

double FastestInWindow(const KeyframeWindow& window) {
  double fastest_mps = 0.0;
  for (std::size_t i = 1; i < window.keyframes.size(); ++i) {
    const Keyframe& before = window.keyframes[i - 1];
    const Keyframe& after = window.keyframes[i];
    fastest_mps =
        std::max(fastest_mps, after.extent_PK.way_m / ToSeconds(after.time - before.time));
  }
  return fastest_mps;
}

/// Where the body was last known to be, and when.
struct LastSeen {
  MonotonicTime time{};
  Eigen::Vector2d p_WB;
  std::int64_t keyframe_id = 0;
};

/// By the last fix before `end` that supports the estimates, or else by the oldest of these.
LastSeen LastSupported(const KeyframeWindow& window,
                       const AttachedFix* end,
                       const ConsensusOptions& options) {
  for (const AttachedFix* fix = end; fix != window.fixes.begin();) {
    --fix;
    if (!SupportsEstimate(window, *fix, options)) continue;
    return {fix->fix.time, window.X_WF(*fix).translation(), fix->keyframe_id};
  }
  const Keyframe& oldest = window.keyframes.front();
  return {oldest.time, oldest.x_WK.head<2>(), oldest.id};
}

}  // namespace

std::optional<OdometryBreak> FindOdometryBreak(const KeyframeWindow& window,
                                               const ConsensusOptions& options) {
  std::vector<ConsensusFix> recent;
  for (const AttachedFix* fix = FirstContradictor(window, options); fix != window.fixes.end();
       ++fix) {
    recent.push_back(AsConsensus(window, *fix));
  }
  const auto consensus = FindConsensus(recent, options);
  if (!consensus || consensus->heading_sigma_rad > kHeadingSigma) return std::nullopt;
  const AttachedFix* first = FirstSupporter(window, consensus->X_WO, options);
  if (first == nullptr || window.fixes.back().fix.time - first->fix.time < kShortest)
    return std::nullopt;

  // While wheels slip the fixes pass from one pose to the other: the break is from where they leave
  // the one to where they are at the other.
  constexpr double kNearSigmas = 3.0;
  const ConsensusOptions near{kNearSigmas, options.min_radius_m};
  const LastSeen last = LastSupported(window, first, near);
  while (first != window.fixes.end() - 1 && !SupportsWith(window, *first, consensus->X_WO, near))
    ++first;
  // Before the oldest keyframe is no motion that could be wrong.
  if (first->keyframe_id == window.keyframes.front().id) return std::nullopt;
  const ConsensusFix after = AsConsensus(window, *first);
  const double way_m = ((consensus->X_WO * after.X_OB).translation() - last.p_WB).norm();
  constexpr double kFaster = 1.5;
  const double reach_m =
      kFaster * FastestInWindow(window) * ToSeconds(first->fix.time - last.time) +
      std::max(kNearSigmas * after.sigma_m, options.min_radius_m);
  if (way_m > reach_m) return std::nullopt;
  return OdometryBreak{
      .last_before = last.keyframe_id, .first_after = first->keyframe_id, .X_WO = consensus->X_WO};
}

void MendOdometryBreak(const OdometryBreak& found, KeyframeWindow& window) {
  const Keyframe& first = window.Get(found.first_after);
  const Eigen::Vector3d change = (first.X_WK().Inverse() * found.X_WO * first.X_OB).Log();
  const auto motions = std::max<std::int64_t>(1, found.first_after - found.last_before);
  const auto shares = static_cast<double>(motions);
  // Twice as uncertain as large, so that the estimates are not held back.
  constexpr double kDoubt = 4.0;
  const Eigen::Vector3d variance = kDoubt / shares * change.cwiseAbs2();
  const Pose2 part = Pose2::Exp(change / shares);
  for (std::int64_t id = found.first_after - motions + 1; id <= found.first_after; ++id) {
    Keyframe& keyframe = window.Get(id);
    keyframe.X_PK = keyframe.X_PK * part;
    keyframe.covariance_PK.diagonal() += variance;
    keyframe.SetX_WK(window.Get(id - 1).X_WK() * keyframe.X_PK);
  }
  for (std::int64_t id = found.first_after; id <= window.keyframes.back().id; ++id) {
    Keyframe& keyframe = window.Get(id);
    keyframe.SetX_WK(found.X_WO * keyframe.X_OB);
    keyframe.fixes += keyframe.gated_fixes;
    keyframe.gated_fixes = 0;
  }
  for (AttachedFix* fix = window.FirstFix(found.first_after); fix != window.fixes.end(); ++fix)
    fix->is_gated = false;
}

}  // namespace relocd
