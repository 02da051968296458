#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "core/time.h"
#include "geometry/planar.h"
#include "geometry/pose2.h"
#include "smoothing/chain_solver.h"
#include "smoothing/consensus.h"
#include "smoothing/fix.h"
#include "smoothing/fix_misfit.h"
#include "smoothing/keyframe_window.h"
#include "smoothing/pose_history.h"
#include "smoothing/smoother_config.h"
#include "smoothing/systematic_errors.h"

namespace relocd {

/// How the body moved until `time`, since the step before.
struct OdometryStep {
  MonotonicTime time{};
  Pose2 X_BprevB;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< Of X_BprevB's right perturbation.
};

/// How far a pose can be trusted. The numbers are those of localization_t.
enum class SmootherStatus {
  kUninitialised = 0,  ///< No heading yet; a position at most.
  kConverging = 1,     ///< Not yet supported by enough fixes, or uncertain.
  kOk = 2,
  kDeadReckoning = 3,  ///< No fix for a while.
  kLost = 4,           ///< The fixes contradict the estimate.
};

/// "uninitialised", "converging", "ok", "dead_reckoning" or "lost".
const char* ToString(SmootherStatus status);

/// Whether a pose's covariance, of the right perturbation, is small enough for the status ok.
bool IsCertain(const Eigen::Matrix3d& covariance, const SmootherConfig& config);

/// How its fixes are weighted.
FixWeighting WeightingOf(const SmootherConfig& config);

/// What is believed of camera and odometry before the first fix.
SystematicErrors SystematicErrorsOf(const SmootherConfig& config);

/// What became of a fix.
enum class FixOutcome {
  kAccepted,
  kGated,      ///< Too far from the prediction; kept as a vote for a relocalisation.
  kRedundant,  ///< Agrees, but as one more of the same place it tells nothing.
  kLate,       ///< Older than the odometry that is kept and what is needed of it.
  kAhead,      ///< Too far ahead of the odometry, or there is none yet.
  kInvalid,    ///< Not finite, or no covariance.
};

/// The newest pose, and how it stands.
struct SmootherEstimate {
  MonotonicTime time{};
  SmootherStatus status = SmootherStatus::kUninitialised;
  bool has_pose = false;  ///< False: before the first fix or prior.
  Pose2 X_WB;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< Of X_WB's right perturbation.
  std::optional<double> time_since_fix_s;
  double distance_since_fix_m = 0.0;
};

struct SmootherCounters {
  std::int64_t fixes_accepted = 0;
  std::int64_t fixes_gated = 0;
  std::int64_t fixes_redundant = 0;
  std::int64_t fixes_late = 0;
  std::int64_t fixes_ahead = 0;
  std::int64_t fixes_invalid = 0;
  std::int64_t odometry_refused = 0;
  std::int64_t relocalizations = 0;
  std::int64_t solver_failures = 0;
};

/// Keeps odometry and fixes of the last some hundred metres, and the most likely way through them.
///
/// Odometry moves the estimate on at once and costs microseconds; every fix is put in at its own
/// time and the whole window solved again, so that early decisions can be taken back. Fixes may
/// come late and out of order. Where many recent fixes agree on another pose than the window's
/// (a wrong start, a robot that was carried), the window is started anew from them.
///
/// Reads no clock, throws nothing, and gives the same bits for the same input. Thread-bound.
class FixedLagSmoother {
 public:
  /// `config` must be valid.
  explicit FixedLagSmoother(const SmootherConfig& config);

  /// Sees each keyframe that leaves the window, and its fixes: for smoothing a whole log.
  using LeaveHandler = std::function<void(const Keyframe&, std::span<const AttachedFix>)>;
  void OnLeave(LeaveHandler handler) { on_leave_ = std::move(handler); }

  /// Starts at, or jumps to, a pose that somebody knows: from a saved state, or set by hand. The
  /// fixes until now are forgotten.
  ///
  /// @return kInvalidInput when it is not finite or its covariance is none.
  Result<void> Reset(const PlanarPose& prior);

  /// Forgets everything but what it has counted, odometry too.
  void Forget();

  /// The first step only says where the odometry begins: its motion is not used.
  ///
  /// @return kInvalidInput when the time does not increase or a number is not usable; the step is
  /// then counted and without effect.
  Result<void> AddOdometry(const OdometryStep& step);

  /// The motion of the last step of odometry, with what it gets wrong all the time put right.
  [[nodiscard]] const Pose2& newest_motion() const { return newest_motion_; }

  FixOutcome AddFix(const Fix& fix);

  [[nodiscard]] SmootherEstimate Estimate() const;

  /// The estimate moved on with the last velocity, or back along the odometry, to another time.
  [[nodiscard]] std::optional<SmootherEstimate> EstimateAt(MonotonicTime time) const;

  [[nodiscard]] const SmootherCounters& counters() const { return counters_; }
  [[nodiscard]] const KeyframeWindow& window() const { return window_; }
  [[nodiscard]] const SmootherConfig& config() const { return config_; }
  [[nodiscard]] const FixWeighting& weighting() const { return weighting_; }
  [[nodiscard]] const SystematicErrors& systematic_errors() const { return window_.systematic; }

 private:
  void Begin(MonotonicTime time);
  void AddKeyframe(OdometrySample& sample);
  /// From the keyframe before to `next`.
  void MoveNewestCovariance(const Keyframe& next);
  void RemoveOldest();
  void ReattachProvisional();

  /// Puts a fix where the body was.
  ///
  /// @return whether what the camera's errors make of it is known: not where they are sought and
  /// the odometry knows no velocity.
  bool Attach(const OdometrySample& sample, AttachedFix& fix) const;
  void Insert(AttachedFix fix);
  void NoteFixesChanged(std::int64_t keyframe_id);
  /// By so many times the fixes' sigmas are to be taken for larger than they say.
  [[nodiscard]] double SigmaFactor() const;
  [[nodiscard]] ConsensusOptions SupportOptions() const;
  [[nodiscard]] double SquaredInnovation(const AttachedFix& fix) const;
  /// @return whether it is one more voter: not right beside another in time.
  bool Remember(const AttachedFix& attached);
  void NoteSupport(const OdometrySample& sample);

  void TryStart();
  /// Where enough of the fixes agree.
  [[nodiscard]] std::optional<Consensus> FindStart(std::span<const ConsensusFix> fixes,
                                                   int fewest) const;
  bool TryMend();
  bool TryRelocalize();
  void Relocalize(const Pose2& X_WO, std::span<const ConsensusFix> voters);
  void Reseed(const Pose2& X_WO);
  void CutBefore(std::int64_t keyframe_id);
  void TakeFixErrors(const FixErrors& errors);
  void SolveWindow(int max_iterations);
  /// So many are to be looked at with one fix, for the systematic errors.
  [[nodiscard]] std::size_t KeyframesForSystematicErrors() const;
  void RestartAtNewest();
  /// The pose is another one now, and what is learned from fixes is soon to be learned from new
  /// ones.
  void NoteStart();

  [[nodiscard]] Pose2 X_WO() const;
  [[nodiscard]] Pose2 X_OF(const AttachedFix& fix) const;
  [[nodiscard]] int SupportersInWindow(const std::optional<Pose2>& X_WO) const;
  [[nodiscard]] SmootherStatus Status(const Eigen::Matrix3d& covariance, MonotonicTime now) const;

  /// A fix in the last ones that may overrule the window.
  struct Voter {
    MonotonicTime time{};
    std::int64_t keyframe_id = 0;
    Pose2 X_KF;
    ConsensusFix fix;
  };
  [[nodiscard]] std::vector<ConsensusFix> VotersAsConsensus() const;
  [[nodiscard]] bool IsSupported(const Voter& voter) const;

  SmootherConfig config_;
  FixWeighting weighting_;
  LeaveHandler on_leave_;
  SmootherCounters counters_;

  PoseHistory history_;
  KeyframeWindow window_;
  ChainSolver chain_;
  FixMisfit misfit_;
  int fixes_until_misfit_ = 0;
  int provisional_fixes_ = 0;  ///< In the window.
  bool is_started_ = false;
  Eigen::Matrix3d newest_covariance_ = Eigen::Matrix3d::Zero();  ///< Of the newest keyframe.
  /// What the systematic errors do to it, along its axes: a part of that covariance.
  BySystematic newest_by_errors_ = BySystematic::Zero();
  std::vector<Voter> voters_;  ///< By time, the newest last.

  Pose2 newest_motion_;
  std::optional<Fix> unstarted_fix_;  ///< The newest, for a first position.
  double odometer_m_ = 0.0;           ///< Of all odometry.
  MotionExtent extent_;               ///< Since the newest keyframe.
  MotionCorrection correction_;       ///< Put into the odometry since then.
  double odometer_at_fix_m_ = 0.0;
  std::optional<MonotonicTime> last_support_;
  std::int64_t fixes_since_start_ = 0;       ///< That were accepted since the pose began anew.
  std::int64_t agreements_since_start_ = 0;  ///< Those that lay where they were predicted.
};

}  // namespace relocd
