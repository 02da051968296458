#include "smoothing/fixed_lag_smoother.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <fmt/format.h>

#include "geometry/angle.h"
#include "geometry/covariance.h"
#include "smoothing/motion_covariance.h"
#include "smoothing/odometry_break.h"

namespace relocd {
namespace {

/// Iterations after a start or a relocalisation, when the estimates are far from the minimum.
constexpr int kStartIterations = 15;
/// Proposals grow with the square of the fixes: so many are looked at for a start.
constexpr std::size_t kMostStartFixes = 60;
/// Positions without heading need more than this many to say how the frames are turned.
constexpr int kFewestPositions = 8;
/// Where so many fixes do not agree, they may err by more than they say.
constexpr std::size_t kDoubtfulFixes = 40;
constexpr double kDoubtFactor = 5.0;
/// A start whose heading is less certain than this would begin on the wrong side.
constexpr double kStartHeadingSigma = 0.5;
/// Fewer recent fixes than this overrule nothing.
constexpr std::size_t kFewestVoters = 8;
/// Whether the fixes contradict the estimate is seen from the last so many.
constexpr std::size_t kLostVoters = 10;
constexpr double kLostShare = 0.2;
/// A fix within so many squared standard deviations of where it was predicted agrees with the pose.
constexpr double kAgreement = 9.0;
/// Below these a body that stands is not more certain: the minimum keeps the matrix regular.
const Eigen::Vector3d kLeastSigmas(1e-3, 1e-3, 1e-4);
/// Variance of an angle of which nothing is known.
constexpr double kUnknownYawVariance = std::numbers::pi * std::numbers::pi / 3.0;
/// Room for so many fixes is made beforehand.
constexpr std::size_t kUsualFixesPerKeyframe = 4;
/// The misfit is measured anew when so many parts of the window's fixes are new, and used when it
/// differs by more than this.
constexpr int kMisfitParts = 30;
constexpr double kMisfitChange = 0.05;
/// The systematic errors are estimated anew when so many parts of the fixes are new: of all fixes,
/// as far back as is not nearly forgotten. Until then each fix has a share of the keyframes looked
/// at.
constexpr std::int64_t kSystematicParts = 50;
constexpr std::int64_t kSystematicMemory = 10000;
/// Motion of a keyframe's first instant: its covariance must be positive definite.
constexpr double kLeastVariance = 1e-10;
/// Least distance and turn that make a body "moving" for the keyframes by time.
constexpr double kStandstill = 0.02;

/// On earth: 1e300 m is finite, and its square is not.
bool IsUsable(const Eigen::Vector2d& position_m) {
  constexpr double kFarthest = 1e8;
  return position_m.squaredNorm() < kFarthest * kFarthest;
}

bool IsUsable(const Pose2& pose) {
  return IsUsable(pose.translation()) && std::isfinite(pose.yaw());
}

/// Sane values only: a variance of 1e308 is finite, and its square is not.
template <int Size>
bool IsUsableCovariance(const Eigen::Matrix<double, Size, Size>& covariance) {
  constexpr double kLargest = 1e10;
  constexpr double kSmallest = 1e-12;
  return IsCovariance(covariance) && covariance.diagonal().maxCoeff() < kLargest &&
         covariance.diagonal().minCoeff() > kSmallest;
}

bool IsUsable(const Fix& fix) {
  if (fix.has_heading) return IsUsable(fix.X_WB) && IsUsableCovariance(fix.covariance);
  return IsUsable(fix.X_WB.translation()) &&
         IsUsableCovariance(Eigen::Matrix2d(fix.covariance.topLeftCorner<2, 2>()));
}

/// A pose's covariance; where it is larger than any map, or by rounding none any more, that of
/// nothing known.
Eigen::Matrix3d AtMostUnknown(const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d unknown = kUnknownSigmas.cwiseAbs2();
  const bool is_known = (covariance.diagonal().array() <= unknown.array()).all();
  return is_known && IsCovariance(covariance) ? covariance : Eigen::Matrix3d(unknown.asDiagonal());
}

double LargestPositionSigma(const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix2d position = covariance.topLeftCorner<2, 2>();
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(position).eigenvalues().y());
}

/// At most `count` of them, evenly taken.
std::vector<ConsensusFix> Thin(const std::vector<ConsensusFix>& fixes, std::size_t count) {
  if (fixes.size() <= count) return fixes;
  std::vector<ConsensusFix> thinned;
  thinned.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    thinned.push_back(fixes[i * (fixes.size() - 1) / (count - 1)]);
  }
  return thinned;
}

}  // namespace

const char* ToString(SmootherStatus status) {
  switch (status) {
    case SmootherStatus::kUninitialised:
      return "uninitialised";
    case SmootherStatus::kConverging:
      return "converging";
    case SmootherStatus::kOk:
      return "ok";
    case SmootherStatus::kDeadReckoning:
      return "dead_reckoning";
    case SmootherStatus::kLost:
      return "lost";
  }
  return "unknown";
}

bool IsCertain(const Eigen::Matrix3d& covariance, const SmootherConfig& config) {
  return LargestPositionSigma(covariance) <= config.ok_sigma_m &&
         std::sqrt(covariance(2, 2)) <= config.ok_heading_sigma_rad;
}

FixWeighting WeightingOf(const SmootherConfig& config) {
  return {config.cauchy_scale_sigmas,
          config.fix_correlation_time_s,
          {.sigmas = config.fix_bias_sigmas, .time_s = config.fix_bias_time_s}};
}

SystematicErrors SystematicErrorsOf(const SmootherConfig& config) {
  SystematicErrors errors;
  errors.prior_sigmas << config.camera_yaw_sigma_rad, config.camera_time_sigma_s,
      config.odometry_scale_sigma, config.odometry_drift_sigma_rad_per_m,
      config.odometry_yaw_rate_sigma_rad_per_s;
  errors.covariance = errors.prior_sigmas.cwiseAbs2().asDiagonal();
  return errors;
}

FixedLagSmoother::FixedLagSmoother(const SmootherConfig& config)
    : config_(config),
      weighting_(WeightingOf(config)),
      history_(FromSeconds(config.max_fix_age_s), FromSeconds(config.max_extrapolation_s)),
      chain_(static_cast<std::size_t>(config.window_keyframes) + 1) {
  window_.systematic = SystematicErrorsOf(config);
  const auto keyframes = static_cast<std::size_t>(config.window_keyframes) + 1;
  window_.keyframes.Reserve(keyframes);
  window_.fixes.Reserve(keyframes * kUsualFixesPerKeyframe);
  voters_.reserve(static_cast<std::size_t>(config.relocalization_window) + 1);
}

Result<void> FixedLagSmoother::Reset(const PlanarPose& prior) {
  if (!IsUsable(prior.X_WB) || !IsUsableCovariance(prior.covariance)) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("resetting the pose: x {} m, y {} m, yaw {} rad or their covariance is "
                    "not usable, must be finite and positive definite",
                    prior.X_WB.x(),
                    prior.X_WB.y(),
                    prior.X_WB.yaw())};
  }
  is_started_ = true;
  unstarted_fix_.reset();
  for (Keyframe& keyframe : window_.keyframes) {
    keyframe.fixes = 0;
    keyframe.gated_fixes = 0;
  }
  window_.fixes.clear();
  provisional_fixes_ = 0;
  chain_.Invalidate();
  voters_.clear();
  window_.last_removed_fix.reset();
  NoteStart();
  window_.prior = KeyframePrior::At(prior);
  newest_covariance_ = prior.covariance;
  newest_by_errors_.setZero();
  if (window_.keyframes.empty()) return {};
  // A keyframe where the body is now: the prior is about this moment.
  OdometrySample sample = history_.newest();
  if (sample.X_KB.translation() != Eigen::Vector2d::Zero() || sample.X_KB.yaw() != 0.0) {
    sample.time += Duration(1);
    AddKeyframe(sample);
    history_.Push(sample);
  }
  while (window_.keyframes.size() > 1)
    RemoveOldest();
  window_.prior = KeyframePrior::At(prior);
  window_.keyframes.front().SetX_WK(prior.X_WB);
  newest_covariance_ = prior.covariance;
  newest_by_errors_.setZero();
  chain_.Invalidate();
  return {};
}

void FixedLagSmoother::Forget() {
  LeaveHandler on_leave = std::move(on_leave_);
  const SmootherCounters counters = counters_;
  *this = FixedLagSmoother(config_);
  on_leave_ = std::move(on_leave);
  counters_ = counters;
}

Result<void> FixedLagSmoother::AddOdometry(const OdometryStep& step) {
  if (history_.empty()) {
    Begin(step.time);
    return {};
  }
  if (step.time <= history_.newest().time) {
    ++counters_.odometry_refused;
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("odometry time is {} ns, must be above the one before's {} ns",
                             ToNanoseconds(step.time),
                             ToNanoseconds(history_.newest().time))};
  }
  Eigen::Matrix3d covariance = config_.odometry_covariance_factor * step.covariance;
  covariance.diagonal().array() += kLeastVariance;
  if (!IsUsable(step.X_BprevB) || !IsUsableCovariance(covariance)) {
    ++counters_.odometry_refused;
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("odometry motion x {} m, y {} m, yaw {} rad or its covariance is not "
                             "usable, must be finite and positive definite",
                             step.X_BprevB.x(),
                             step.X_BprevB.y(),
                             step.X_BprevB.yaw())};
  }
  covariance = AtMostUnknown(covariance);
  const auto motion =
      MotionExtent::Of(step.X_BprevB, ToSeconds(step.time - history_.newest().time));
  const auto correction = MotionCorrection::Of(motion, OdometryPart(window_.systematic.estimate));
  const Pose2 X_AB = CorrectMotion(step.X_BprevB, motion, correction);
  newest_motion_ = X_AB;
  OdometrySample sample = history_.newest();
  sample.time = step.time;
  sample.X_OB = sample.X_OB * X_AB;
  sample.X_KB = sample.X_KB * X_AB;
  sample.covariance_KB = ComposeCovariance(sample.covariance_KB, X_AB, covariance);
  sample.step_covariance = covariance;
  odometer_m_ += motion.way_m;
  extent_ += motion;
  correction_ += correction;

  const double distance = sample.X_KB.translation().norm();
  const double turn = std::abs(sample.X_KB.yaw());
  const bool moves = distance > kStandstill || turn > kStandstill;
  const Duration age = sample.time - window_.keyframes.back().time;
  if (distance >= config_.keyframe_distance_m || turn >= config_.keyframe_angle_rad ||
      (moves && age >= FromSeconds(config_.keyframe_interval_s))) {
    AddKeyframe(sample);
  }
  history_.Push(sample);
  ReattachProvisional();
  return {};
}

void FixedLagSmoother::Begin(MonotonicTime time) {
  Keyframe keyframe;
  keyframe.time = time;
  if (window_.prior) keyframe.SetX_WK(window_.prior->X_WK());
  window_.keyframes.push_back(std::move(keyframe));
  OdometrySample sample;
  sample.time = time;
  history_.Push(sample);
}

void FixedLagSmoother::AddKeyframe(OdometrySample& sample) {
  const Keyframe& before = window_.keyframes.back();
  Keyframe keyframe;
  keyframe.id = before.id + 1;
  keyframe.time = sample.time;
  keyframe.generation = before.generation;
  keyframe.X_OB = sample.X_OB;
  keyframe.X_PK = sample.X_KB;
  keyframe.covariance_PK = sample.covariance_KB;
  keyframe.extent_PK = std::exchange(extent_, {});
  keyframe.correction_PK = std::exchange(correction_, {});
  keyframe.SetX_WK(before.X_WK() * keyframe.X_PK);
  MoveNewestCovariance(keyframe);
  window_.keyframes.push_back(std::move(keyframe));

  sample.keyframe_id = window_.keyframes.back().id;
  sample.X_KB = Pose2();
  sample.covariance_KB.setZero();
  while (window_.keyframes.size() > static_cast<std::size_t>(config_.window_keyframes)) {
    RemoveOldest();
  }
}

void FixedLagSmoother::MoveNewestCovariance(const Keyframe& next) {
  const SystematicMatrix& errors = window_.systematic.covariance;
  const Eigen::Matrix3d back = next.X_PK.Inverse().Adjoint();
  BySystematic by_errors = back * newest_by_errors_;
  const Eigen::Matrix3d before = by_errors * errors * by_errors.transpose();
  by_errors.rightCols<3>() += Pose2(0.0, 0.0, -next.X_PK.yaw()).Adjoint() *
                              MotionByOdometryErrors(next.X_PK, next.extent_PK);
  const Eigen::Matrix3d moved =
      ComposeCovariance(newest_covariance_, next.X_PK, next.covariance_PK) +
      by_errors * errors * by_errors.transpose() - before;
  newest_covariance_ = AtMostUnknown(moved);
  newest_by_errors_ = newest_covariance_ == moved ? by_errors : BySystematic(BySystematic::Zero());
}

void FixedLagSmoother::RemoveOldest() {
  const std::int64_t id = window_.keyframes.front().id;
  const AttachedFix* const end = window_.FirstFix(id + 1);
  if (on_leave_) on_leave_(window_.keyframes.front(), {window_.fixes.begin(), end});
  provisional_fixes_ -= static_cast<int>(
      std::count_if(window_.fixes.begin(), window_.FirstFix(id + 1), [](const AttachedFix& fix) {
        return fix.is_provisional;
      }));
  const bool had_prior = window_.prior.has_value();
  chain_.MarginalizeOldest(window_, weighting_);
  // Before the start the estimates mean nothing, and so would a prior from them.
  if (!is_started_ && !had_prior) {
    window_.prior.reset();
    window_.systematic.before_window = {};
  }
}

void FixedLagSmoother::ReattachProvisional() {
  const std::int64_t newest_id = window_.keyframes.back().id;
  int remaining = provisional_fixes_;
  for (std::size_t i = window_.fixes.size(); remaining > 0 && i-- > 0;) {
    AttachedFix& fix = window_.fixes[i];
    if (!fix.is_provisional) continue;
    --remaining;
    // One that is still ahead goes to the newest keyframe: keyframes are in the order of the times.
    if (fix.fix.time > history_.newest().time && fix.keyframe_id == newest_id) continue;
    const std::int64_t id = fix.keyframe_id;
    const auto count = [&](int change) {
      Keyframe& keyframe = window_.Get(fix.keyframe_id);
      (fix.is_gated ? keyframe.gated_fixes : keyframe.fixes) += change;
    };
    const auto sample = history_.At(fix.fix.time);
    if (sample) {
      count(-1);
      static_cast<void>(Attach(*sample, fix));
      count(1);
      NoteFixesChanged(id);
    } else {
      fix.is_provisional = false;
    }
    if (!fix.is_provisional) --provisional_fixes_;
  }
}

bool FixedLagSmoother::Attach(const OdometrySample& sample, AttachedFix& fix) const {
  fix.keyframe_id = sample.keyframe_id;
  fix.X_KB = sample.X_KB;
  fix.covariance_KB = sample.covariance_KB;
  fix.is_provisional = sample.is_extrapolated;
  bool is_complete = true;
  if (window_.systematic.IsCameraSought()) {
    const auto velocity = history_.VelocityAt(sample.time);
    is_complete = velocity.has_value();
    fix.is_provisional = history_.newest().time < sample.time + PoseHistory::kVelocityReach;
    // A camera that looks to the left has the body turned about the camera, and a late time has it
    // where it is no more.
    const Eigen::Vector2d& p_BC = fix.fix.p_BC;
    if (fix.fix.has_heading) fix.X_BF_by_camera.col(0) << p_BC.y(), -p_BC.x(), 1.0;
    if (velocity) fix.X_BF_by_camera.col(1) = -*velocity;
  }
  PrepareResidual(fix, CameraPart(window_.systematic.estimate));
  return is_complete;
}

void FixedLagSmoother::Insert(AttachedFix fix) {
  if (fix.is_provisional) ++provisional_fixes_;
  const std::int64_t id = fix.keyframe_id;
  window_.Insert(std::move(fix));
  NoteFixesChanged(id);
}

void FixedLagSmoother::NoteFixesChanged(std::int64_t keyframe_id) {
  chain_.FixesChanged(keyframe_id,
                      UpdateShares(window_, config_.fix_correlation_time_s, keyframe_id));
}

/// Not before some fixes lay where they were predicted: about a pose that is wrong all of them
/// scatter.
double FixedLagSmoother::SigmaFactor() const {
  return agreements_since_start_ < config_.ok_fixes ? 1.0 : weighting_.SigmaFactor();
}

ConsensusOptions FixedLagSmoother::SupportOptions() const {
  return {.radius_sigmas = SigmaFactor() * config_.relocalization_radius_sigmas,
          .min_radius_m = config_.relocalization_min_radius_m};
}

double FixedLagSmoother::SquaredInnovation(const AttachedFix& fix) const {
  const Pose2 X_WF = window_.X_WF(fix);
  const Pose2& X_WM = fix.fix.X_WB;
  const Eigen::Matrix3d predicted =
      ComposeCovariance(newest_covariance_, fix.X_KF, fix.covariance_KB);
  const Eigen::Matrix2d R_WF = Eigen::Rotation2Dd(X_WF.yaw()).toRotationMatrix();
  const Eigen::Vector2d error_W = X_WM.translation() - X_WF.translation();
  const Eigen::Matrix3d measured = SigmaFactor() * SigmaFactor() * fix.fix.covariance;
  if (!fix.fix.has_heading) {
    const Eigen::Matrix2d innovation =
        R_WF * predicted.topLeftCorner<2, 2>() * R_WF.transpose() + measured.topLeftCorner<2, 2>();
    return SquaredMahalanobis(error_W, innovation);
  }
  // Both along F's axes: they differ from the measured ones by the heading's error.
  Eigen::Vector3d error;
  error << R_WF.transpose() * error_W, WrapAngle(X_WM.yaw() - X_WF.yaw());
  const Eigen::Matrix3d innovation = predicted + measured;
  return SquaredMahalanobis(error, innovation);
}

FixOutcome FixedLagSmoother::AddFix(const Fix& fix) {
  if (!IsUsable(fix)) {
    ++counters_.fixes_invalid;
    return FixOutcome::kInvalid;
  }
  if (history_.empty()) {
    ++counters_.fixes_ahead;
    return FixOutcome::kAhead;
  }
  const auto sample = history_.At(fix.time);
  if (!sample) {
    const bool is_ahead = fix.time > history_.newest().time;
    ++(is_ahead ? counters_.fixes_ahead : counters_.fixes_late);
    return is_ahead ? FixOutcome::kAhead : FixOutcome::kLate;
  }
  AttachedFix attached;
  attached.fix = fix;
  if (!window_.Has(sample->keyframe_id) || !Attach(*sample, attached)) {
    ++counters_.fixes_late;
    return FixOutcome::kLate;
  }
  const bool is_voter = Remember(attached);
  if (!is_started_) {
    if (!unstarted_fix_ || fix.time > unstarted_fix_->time) unstarted_fix_ = fix;
    if (window_.Get(sample->keyframe_id).fixes < config_.max_fixes_per_keyframe) {
      Insert(std::move(attached));
    }
    ++counters_.fixes_accepted;
    ++fixes_since_start_;
    NoteSupport(*sample);
    TryStart();
    return FixOutcome::kAccepted;
  }

  const double squared_innovation = SquaredInnovation(attached);
  attached.is_gated = squared_innovation > config_.gate_squared_mahalanobis;
  if (is_voter && squared_innovation <= kAgreement) ++agreements_since_start_;
  const Keyframe& keyframe = window_.Get(sample->keyframe_id);
  // A new start makes fixes that were gated count: together they may be twice as many, and no more.
  const int most = config_.max_fixes_per_keyframe;
  const bool is_full = (attached.is_gated ? keyframe.gated_fixes : keyframe.fixes) >= most ||
                       keyframe.gated_fixes + keyframe.fixes >= 2 * most;
  const FixOutcome outcome = attached.is_gated ? FixOutcome::kGated
                             : is_full         ? FixOutcome::kRedundant
                                               : FixOutcome::kAccepted;
  if (outcome != FixOutcome::kGated) NoteSupport(*sample);
  if (outcome == FixOutcome::kAccepted) {
    ++counters_.fixes_accepted;
    ++fixes_since_start_;
    Insert(std::move(attached));
    SolveWindow(config_.max_iterations);
  } else if (outcome == FixOutcome::kGated) {
    ++counters_.fixes_gated;
    if (!is_full) Insert(std::move(attached));
  } else {
    ++counters_.fixes_redundant;
  }
  if (!TryMend()) TryRelocalize();
  return outcome;
}

void FixedLagSmoother::NoteSupport(const OdometrySample& sample) {
  if (!last_support_ || sample.time > *last_support_) {
    last_support_ = sample.time;
    odometer_at_fix_m_ = odometer_m_;
  }
}

bool FixedLagSmoother::Remember(const AttachedFix& attached) {
  const Fix& fix = attached.fix;
  const auto after = std::upper_bound(
      voters_.begin(), voters_.end(), fix.time, [](MonotonicTime time, const Voter& voter) {
        return time < voter.time;
      });
  const Duration spacing = FromSeconds(config_.relocalization_spacing_s);
  if (after != voters_.begin() && fix.time - std::prev(after)->time < spacing) return false;
  if (after != voters_.end() && after->time - fix.time < spacing) return false;
  Voter voter;
  voter.time = fix.time;
  voter.keyframe_id = attached.keyframe_id;
  voter.X_KF = attached.X_KF;
  voter.fix = ToConsensusFix(fix, X_OF(attached));
  voters_.insert(after, voter);
  if (voters_.size() > static_cast<std::size_t>(config_.relocalization_window)) {
    voters_.erase(voters_.begin());
  }
  return true;
}

Pose2 FixedLagSmoother::X_WO() const {
  const Keyframe& newest = window_.keyframes.back();
  return newest.X_WK() * newest.X_OB.Inverse();
}

void FixedLagSmoother::TryStart() {
  std::vector<ConsensusFix> fixes;
  for (const AttachedFix& fix : window_.fixes)
    fixes.push_back(ToConsensusFix(fix.fix, X_OF(fix)));
  const auto with_heading = std::count_if(
      fixes.begin(), fixes.end(), [](const ConsensusFix& fix) { return fix.has_heading; });
  const int fewest = with_heading >= config_.start_fixes
                         ? config_.start_fixes
                         : std::max(config_.start_fixes, kFewestPositions);
  if (static_cast<int>(fixes.size()) < fewest) return;
  fixes = Thin(fixes, kMostStartFixes);
  auto consensus = FindStart(fixes, fewest);
  if (!consensus && fixes.size() >= kDoubtfulFixes) {
    for (ConsensusFix& fix : fixes) {
      fix.sigma_m *= kDoubtFactor;
      fix.heading_sigma_rad *= kDoubtFactor;
    }
    consensus = FindStart(fixes, fewest);
  }
  if (!consensus) return;
  is_started_ = true;
  NoteStart();
  Reseed(consensus->X_WO);
}

std::optional<Consensus> FixedLagSmoother::FindStart(std::span<const ConsensusFix> fixes,
                                                     int fewest) const {
  auto consensus = FindConsensus(fixes, SupportOptions());
  const double share = config_.start_inlier_share * static_cast<double>(fixes.size());
  if (!consensus || consensus->supporters < std::max(static_cast<double>(fewest), share) ||
      consensus->heading_sigma_rad > kStartHeadingSigma) {
    return std::nullopt;
  }
  return consensus;
}

void FixedLagSmoother::Reseed(const Pose2& X_WO) {
  for (Keyframe& keyframe : window_.keyframes) {
    keyframe.SetX_WK(X_WO * keyframe.X_OB);
    keyframe.generation = counters_.relocalizations + 1;
  }
  for (AttachedFix& fix : window_.fixes)
    fix.is_gated = false;
  for (Keyframe& keyframe : window_.keyframes) {
    keyframe.fixes += keyframe.gated_fixes;
    keyframe.gated_fixes = 0;
  }
  window_.prior.reset();
  window_.last_removed_fix.reset();
  UpdateAllShares(window_, config_.fix_correlation_time_s);
  chain_.Invalidate();
  SolveWindow(kStartIterations);
}

std::vector<ConsensusFix> FixedLagSmoother::VotersAsConsensus() const {
  std::vector<ConsensusFix> fixes;
  fixes.reserve(voters_.size());
  for (const Voter& voter : voters_)
    fixes.push_back(voter.fix);
  return fixes;
}

bool FixedLagSmoother::IsSupported(const Voter& voter) const {
  const Pose2 X_WB = window_.Has(voter.keyframe_id)
                         ? window_.Get(voter.keyframe_id).X_WK() * voter.X_KF
                         : X_WO() * voter.fix.X_OB;
  return Supports(voter.fix, X_WB, SupportOptions());
}

bool FixedLagSmoother::TryMend() {
  const auto found = FindOdometryBreak(window_, SupportOptions());
  if (!found) return false;
  ++counters_.relocalizations;
  NoteStart();
  MendOdometryBreak(*found, window_);
  UpdateAllShares(window_, config_.fix_correlation_time_s);
  chain_.Invalidate();
  SolveWindow(kStartIterations);
  return true;
}

bool FixedLagSmoother::TryRelocalize() {
  if (voters_.size() < kFewestVoters) return false;
  const auto supported = static_cast<int>(std::count_if(
      voters_.begin(), voters_.end(), [this](const Voter& voter) { return IsSupported(voter); }));
  // Another pose must have far more support than this one. The numbers are those with which a
  // carried robot was found again within 32 fixes, and none that was not carried was moved.
  const int needed = std::max(3 * supported + 8,
                              static_cast<int>(std::ceil(config_.relocalization_inlier_share *
                                                         static_cast<double>(voters_.size()))));
  if (static_cast<int>(voters_.size()) < needed) return false;
  const std::vector<ConsensusFix> fixes = VotersAsConsensus();
  const auto consensus = FindConsensus(fixes, SupportOptions());
  if (!consensus || consensus->supporters < needed) return false;
  ++counters_.relocalizations;
  NoteStart();
  Relocalize(consensus->X_WO, fixes);
  return true;
}

Pose2 FixedLagSmoother::X_OF(const AttachedFix& fix) const {
  return window_.Get(fix.keyframe_id).X_OB * fix.X_KF;
}

int FixedLagSmoother::SupportersInWindow(const std::optional<Pose2>& X_WO) const {
  return static_cast<int>(
      std::count_if(window_.fixes.begin(), window_.fixes.end(), [&](const AttachedFix& attached) {
        const ConsensusFix fix = ToConsensusFix(attached.fix, X_OF(attached));
        return Supports(fix, X_WO ? *X_WO * fix.X_OB : window_.X_WF(attached), SupportOptions());
      }));
}

void FixedLagSmoother::Relocalize(const Pose2& X_WO, std::span<const ConsensusFix> voters) {
  // Either the window was wrong from its start, and all of it moves; or the body was carried, and
  // what was before the first fix at the new place is right but over.
  if (SupportersInWindow(X_WO) < SupportersInWindow(std::nullopt)) {
    int balance = 0;
    int best_balance = 0;
    std::size_t first = voters.size() - 1;
    for (std::size_t i = voters.size(); i-- > 0;) {
      balance += Supports(voters[i], X_WO * voters[i].X_OB, SupportOptions()) ? 1 : -1;
      if (balance <= best_balance) continue;
      best_balance = balance;
      first = i;
    }
    CutBefore(voters_[first].keyframe_id);
  }
  Reseed(X_WO);
}

void FixedLagSmoother::CutBefore(std::int64_t keyframe_id) {
  while (window_.keyframes.size() > 1 && window_.keyframes.front().id < keyframe_id)
    RemoveOldest();
  window_.keyframes.front().is_cut = true;
  std::erase_if(voters_, [&](const Voter& voter) { return voter.keyframe_id < keyframe_id; });
}

void FixedLagSmoother::TakeFixErrors(const FixErrors& errors) {
  const double change = std::abs(errors.misfit / weighting_.misfit() - 1.0);
  if (change > kMisfitChange) weighting_.SetMisfit(errors.misfit);
  if (!weighting_.SetScatter(errors.scatter)) return;
  chain_.FixesChanged(window_.keyframes.front().id, window_.keyframes.back().id);
}

void FixedLagSmoother::SolveWindow(int max_iterations) {
  if (--fixes_until_misfit_ <= 0) {
    fixes_until_misfit_ = static_cast<int>(window_.fixes.size()) / kMisfitParts;
    TakeFixErrors(misfit_.Measure(window_, weighting_));
  }
  bool is_solved = chain_.Solve(window_, weighting_, max_iterations);
  is_solved = is_solved &&
              chain_.EstimateSystematicErrors(window_, weighting_, KeyframesForSystematicErrors());
  if (is_solved) {
    newest_covariance_ = chain_.NewestCovariance(window_, weighting_);
    newest_by_errors_ = chain_.NewestBySystematicErrors();
    if (IsCovariance(newest_covariance_)) return;
  }
  ++counters_.solver_failures;
  RestartAtNewest();
}

void FixedLagSmoother::NoteStart() {
  fixes_since_start_ = 0;
  agreements_since_start_ = 0;
  fixes_until_misfit_ = 0;
}

std::size_t FixedLagSmoother::KeyframesForSystematicErrors() const {
  const std::int64_t fixes = std::min(fixes_since_start_, kSystematicMemory) / kSystematicParts;
  return window_.keyframes.size() / static_cast<std::size_t>(std::max(fixes, std::int64_t{1})) + 1;
}

void FixedLagSmoother::RestartAtNewest() {
  NoteStart();
  Keyframe newest = window_.keyframes.back();
  constexpr double kDoubt = 4.0;
  newest_covariance_ *= kDoubt;
  newest_covariance_.diagonal() += kLeastSigmas.cwiseAbs2();
  newest_covariance_ = AtMostUnknown(newest_covariance_);
  newest_by_errors_.setZero();
  window_.keyframes.clear();
  window_.fixes.clear();
  provisional_fixes_ = 0;
  window_.last_removed_fix.reset();
  window_.systematic = SystematicErrorsOf(config_);
  chain_.Invalidate();
  newest.fixes = 0;
  newest.gated_fixes = 0;
  window_.prior = KeyframePrior{.x_WK = newest.x_WK, .covariance = newest_covariance_};
  window_.keyframes.push_back(std::move(newest));
}

SmootherEstimate FixedLagSmoother::Estimate() const {
  if (history_.empty()) return {};
  return EstimateAt(history_.newest().time).value_or(SmootherEstimate());
}

std::optional<SmootherEstimate> FixedLagSmoother::EstimateAt(MonotonicTime time) const {
  const auto sample = history_.At(time);
  if (!sample || !window_.Has(sample->keyframe_id)) return std::nullopt;
  SmootherEstimate estimate;
  estimate.time = time;
  if (last_support_) {
    estimate.time_since_fix_s = std::max(0.0, ToSeconds(time - *last_support_));
    estimate.distance_since_fix_m = odometer_m_ - odometer_at_fix_m_;
  }
  if (!is_started_) {
    if (!unstarted_fix_) return estimate;
    // The way since then is known, its direction is not.
    const double way = estimate.distance_since_fix_m;
    estimate.has_pose = true;
    estimate.X_WB = {unstarted_fix_->X_WB.x(), unstarted_fix_->X_WB.y(), 0.0};
    estimate.covariance.setZero();
    estimate.covariance.topLeftCorner<2, 2>() =
        unstarted_fix_->covariance.topLeftCorner<2, 2>() + way * way * Eigen::Matrix2d::Identity();
    estimate.covariance(2, 2) = kUnknownYawVariance;
    return estimate;
  }
  estimate.has_pose = true;
  estimate.X_WB = window_.Get(sample->keyframe_id).X_WK() * sample->X_KB;
  estimate.covariance = ComposeCovariance(newest_covariance_, sample->X_KB, sample->covariance_KB);
  estimate.covariance.diagonal() += kLeastSigmas.cwiseAbs2();
  estimate.covariance = AtMostUnknown(estimate.covariance);
  estimate.status = Status(estimate.covariance, time);
  return estimate;
}

SmootherStatus FixedLagSmoother::Status(const Eigen::Matrix3d& covariance,
                                        MonotonicTime now) const {
  const std::size_t recent = std::min(voters_.size(), kLostVoters);
  const auto supported = std::count_if(voters_.end() - static_cast<std::ptrdiff_t>(recent),
                                       voters_.end(),
                                       [this](const Voter& voter) { return IsSupported(voter); });
  if (recent >= kLostVoters / 2 &&
      static_cast<double>(supported) <= kLostShare * static_cast<double>(recent)) {
    return SmootherStatus::kLost;
  }
  if (!last_support_ || ToSeconds(now - *last_support_) > config_.dead_reckoning_after_s) {
    return SmootherStatus::kDeadReckoning;
  }
  if (agreements_since_start_ < config_.ok_fixes || !IsCertain(covariance, config_)) {
    return SmootherStatus::kConverging;
  }
  return SmootherStatus::kOk;
}

}  // namespace relocd
