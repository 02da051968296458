#include "smoothing/chain_solver.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/check.h"

namespace relocd {
namespace {

/// A keyframe that turned by more has its motion linearised anew: what is then neglected is the
/// motion's length times half the square of it.
constexpr double kLinearTurn = 1e-3;
/// A keyframe that moved by this part of a fix's sigma has its fixes weighted anew.
constexpr double kLinearShare = 0.01;
/// Poses that would move by less are left, and all before them.
constexpr double kLeastLength = 2e-5;
constexpr double kLeastTurn = 2e-6;
/// An iteration that moved by less was the last one.
constexpr double kSettledLength = 1e-4;
constexpr double kSettledTurn = 1e-5;
/// A step that turns a keyframe by more is looked at: has it lowered the cost?
constexpr double kDoubtfulTurn = 0.1;
/// Systematic errors whose estimates change by a smaller part of what is not known of them are left
/// as they are: to put all motions and poses right costs what many fixes do.
constexpr double kLeastSystematicChange = 0.03;
/// A keyframe that leaves takes this part of what is known of the systematic errors with it: a
/// camera that was knocked is seen within some thousand keyframes.
constexpr double kForgotten = 5e-4;
/// And this part, where an error is larger than so many sigmas of its prior: it is hardly one that
/// stays. Wheels that spin for long are not of another size.
constexpr double kForgottenOfImplausible = 0.05;
constexpr double kImplausible = 4.0;
/// Information with which a damped step holds the estimates, of 1 m and 0.1 rad.
const Eigen::Vector3d kDampingInformation(1.0, 1.0, 100.0);

Eigen::Matrix3d Symmetric(const Eigen::Matrix3d& matrix) {
  return 0.5 * (matrix + matrix.transpose());
}

/// The rotation by `yaw` of a planar tangent (x, y, yaw).
Eigen::Matrix3d TangentRotation(double yaw) {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  rotation.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(yaw).toRotationMatrix();
  return rotation;
}

/// Whether a pose that moves by so much may be left where it is.
bool IsLeast(const Eigen::Vector3d& moved) {
  return moved.head<2>().lpNorm<Eigen::Infinity>() < kLeastLength &&
         std::abs(moved.z()) < kLeastTurn;
}

/// A covariance along W's axes, of one along those of a body that looks to `yaw`.
Eigen::Matrix3d AlongMap(const Eigen::Matrix3d& covariance, double yaw) {
  const Eigen::Matrix3d rotation = TangentRotation(yaw);
  return Symmetric(rotation * covariance * rotation.transpose());
}

/// The covariance of the systematic errors if fixes erred independently, also where a prior of 0
/// says that there is none.
SystematicMatrix SystematicPosterior(const SystematicVector& prior_sigmas,
                                     const SystematicMatrix& information) {
  const SystematicMatrix sigmas = prior_sigmas.asDiagonal();
  const SystematicMatrix scaled = SystematicMatrix::Identity() + sigmas * information * sigmas;
  return sigmas * scaled.ldlt().solve(sigmas);
}

SystematicMatrix SystematicCovariance(const SystematicMatrix& posterior,
                                      const SystematicKnowledge& known,
                                      const FixWeighting& weighting) {
  return posterior + weighting.BiasVariance() * posterior * known.bias_covariance * posterior;
}

}  // namespace

/// Leaves what is known of the systematic errors to the window's next keyframe, but for a little.
void ChainSolver::ForgetSystematic(const SystematicState& next, KeyframeWindow& window) {
  const SystematicErrors& errors = window.systematic;
  const bool is_plausible =
      (errors.estimate.array().abs() <= kImplausible * errors.prior_sigmas.array()).all();
  const double kept = 1.0 - (is_plausible ? kForgotten : kForgottenOfImplausible);
  window.prior->systematic = {.by_errors = next.effect.by_errors,
                              .bias_cross = kept * next.effect.bias_cross};
  window.systematic.before_window = {.information = kept * next.known.information,
                                     .rhs = kept * next.known.rhs,
                                     .bias_covariance = kept * kept * next.known.bias_covariance,
                                     .bias_cross = kept * next.known.bias_cross};
}

ChainSolver::ChainSolver(std::size_t capacity) : nodes_(capacity), systematic_(capacity) {}

void ChainSolver::Invalidate() {
  nodes_.clear();
  systematic_.clear();
  first_dirty_ = 0;
  first_systematic_dirty_ = 0;
  next_systematic_ = 0;
}

void ChainSolver::FixesChanged(std::int64_t first_id, std::int64_t last_id) {
  if (nodes_.empty()) return;  // nodes are new when they are made
  const std::int64_t oldest = nodes_.front().id;
  const std::int64_t first = std::max(first_id, oldest);
  for (std::int64_t id = first; id <= std::min(last_id, nodes_.back().id); ++id)
    nodes_[static_cast<std::size_t>(id - oldest)].are_fixes_new = true;
  first_systematic_dirty_ =
      std::min(first_systematic_dirty_, static_cast<std::size_t>(first - oldest));
}

void ChainSolver::Synchronize(const KeyframeWindow& window, const FixWeighting& weighting) {
  while (!nodes_.empty() && nodes_.front().id < window.keyframes.front().id) {
    nodes_.pop_front();
    systematic_.pop_front();
    if (first_dirty_ > 0) --first_dirty_;
    if (first_systematic_dirty_ > 0) --first_systematic_dirty_;
    if (next_systematic_ > 0) --next_systematic_;
  }
  for (std::size_t i = nodes_.size(); i < window.keyframes.size(); ++i) {
    const Keyframe& keyframe = window.keyframes[i];
    Node node;
    node.id = keyframe.id;
    node.reference = keyframe.x_WK;
    if (i > 0) {
      node.bias_kept = weighting.BiasKept(ToSeconds(keyframe.time - window.keyframes[i - 1].time));
    }
    nodes_.push_back(node);
    systematic_.push_back({});
    TakeMotion(keyframe, i);
    first_dirty_ = std::min(first_dirty_, i);
    first_systematic_dirty_ = std::min(first_systematic_dirty_, i);
  }
  RELOCD_CHECK(
      nodes_.size() == window.keyframes.size() && nodes_.front().id == window.keyframes.front().id,
      "the window was changed, and the solver not told");
}

void ChainSolver::TakeMotion(const Keyframe& keyframe, std::size_t i) {
  nodes_[i].residual = keyframe.MotionResidual();
  nodes_[i].is_motion_new = true;
  systematic_[i].motion_P_by_odometry = MotionByOdometryErrors(keyframe.X_PK, keyframe.extent_PK);
}

void ChainSolver::Linearize(KeyframeWindow& window, const FixWeighting& weighting) {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    Node& node = nodes_[i];
    const bool is_turned =
        i > 0 && std::abs(nodes_[i - 1].estimate().z() - node.motion_yaw) > kLinearTurn;
    const bool is_motion_changed = i > 0 && (node.is_motion_new || is_turned);
    if (is_motion_changed) LinearizeMotion(i);
    if (node.has_fixes && !node.are_fixes_new) {
      const Eigen::Vector3d moved = node.estimate() - node.weighted_at;
      const double squared = node.largest_information_m * moved.head<2>().squaredNorm() +
                             node.largest_information_rad * moved.z() * moved.z();
      node.are_fixes_new = squared > kLinearShare * kLinearShare;
    }
    const bool are_fixes_changed = node.are_fixes_new;
    if (are_fixes_changed) LinearizeFixes(window, weighting, node);
    if (is_motion_changed || are_fixes_changed) first_dirty_ = std::min(first_dirty_, i);
  }
}

void ChainSolver::LinearizeMotion(std::size_t i) {
  const Node& before = nodes_[i - 1];
  Node& node = nodes_[i];
  const auto at = node.residual.Linearize(before.estimate(), node.estimate());
  const Eigen::Vector3d error = at.error - at.by_A * before.delta - at.by_B * node.delta;
  // by_A * delta_before + by_B * delta + error is zero but for the noise. by_B is a rotation, its
  // transpose its inverse, and by_A is -by_B but for what a turn does.
  node.motion.arm = -(at.by_B.transpose() * at.by_A.col(2));
  node.motion.arm.z() = 0.0;
  node.motion.offset = -(at.by_B.transpose() * error);
  node.motion.covariance = Symmetric(at.by_B.transpose() * node.residual.covariance() * at.by_B);
  node.motion_yaw = before.estimate().z();
  SystematicNode& systematic = systematic_[i];
  systematic.motion_by_odometry = at.by_B.transpose() * systematic.motion_P_by_odometry;
  node.is_motion_new = false;
}

void ChainSolver::LinearizeFixes(KeyframeWindow& window,
                                 const FixWeighting& weighting,
                                 Node& node) {
  node.information.setZero();
  node.rhs.setZero();
  node.rhs_by_bias.setZero();
  node.largest_information_m = 0.0;
  node.largest_information_rad = 0.0;
  node.weighted_at = node.estimate();
  node.are_fixes_new = false;
  node.has_fixes = false;
  SystematicNode& systematic = systematic_[static_cast<std::size_t>(node.id - nodes_.front().id)];
  const bool is_camera_sought = window.systematic.IsCameraSought();
  if (is_camera_sought) systematic.fixes = {};
  for (AttachedFix* fix = window.FirstFix(node.id);
       fix != window.fixes.end() && fix->keyframe_id == node.id;
       ++fix) {
    if (fix->share <= 0.0) continue;
    const AbsolutePoseResidual::Linearization at = fix->residual.Linearize(node.weighted_at);
    const Eigen::Matrix3d& information = fix->residual.information();
    const double squared = at.error.dot(information * at.error);
    const double weight = weighting.BaseWeight(*fix) * weighting.KernelWeight(squared);
    const Eigen::Matrix3d gradient = weight * at.by_K.transpose() * information;
    node.information += gradient * at.by_K;
    node.rhs -= gradient * (at.error - at.by_K * node.delta);
    node.rhs_by_bias += gradient * fix->covariance_root;
    if (is_camera_sought) {
      const ByCamera by_camera = fix->ErrorByCamera(node.weighted_at.z());
      const Eigen::Matrix<double, 2, 3> camera_gradient =
          weight * by_camera.transpose() * information;
      systematic.fixes.pose_rhs_by_camera -= gradient * by_camera;
      systematic.fixes.information += camera_gradient * by_camera;
      systematic.fixes.rhs_by_bias += camera_gradient * fix->covariance_root;
      systematic.fixes.rhs -= camera_gradient * (at.error - at.by_K * node.delta);
    }
    node.largest_information_m =
        std::max({node.largest_information_m, information(0, 0), information(1, 1)});
    node.largest_information_rad = std::max(node.largest_information_rad, information(2, 2));
    node.has_fixes = true;
  }
}

ChainSolver::Prediction ChainSolver::FromPrior(const KeyframeWindow& window) const {
  if (!window.prior) {
    return {Eigen::Vector3d::Zero(), kUnknownSigmas.cwiseAbs2().asDiagonal(), {}};
  }
  const KeyframePrior& prior = *window.prior;
  return {prior.x_WK - nodes_.front().reference,
          AlongMap(prior.covariance, prior.x_WK.z()),
          prior.bias};
}

ChainSolver::Prediction ChainSolver::Predict(std::size_t i) {
  Node& before = nodes_[i - 1];
  const Node& node = nodes_[i];
  const LinearMotion& motion = node.motion;
  Prediction predicted;
  predicted.mean = before.mean + motion.arm * before.mean.z() + motion.offset;
  predicted.covariance = Symmetric(motion.MoveBoth(before.covariance)) + motion.covariance;
  before.gain = motion.Move(before.covariance).transpose() * predicted.covariance.inverse();
  before.offset = before.mean - before.gain * predicted.mean;
  predicted.bias.covariance = Symmetric(motion.MoveBoth(before.bias.covariance));
  predicted.bias.cross = node.bias_kept * motion.Move(before.bias.cross);
  return predicted;
}

void ChainSolver::Correct(const Prediction& predicted, double misfit, double damping, Node& node) {
  if (!node.has_fixes && damping <= 0.0) {
    node.mean = predicted.mean;
    node.covariance = predicted.covariance;
    node.bias = predicted.bias;
    return;
  }
  Eigen::Matrix3d information = node.information / misfit;
  Eigen::Vector3d rhs = node.rhs / misfit;
  if (damping > 0.0) {
    const Eigen::Vector3d hold = damping * kDampingInformation;
    information.diagonal() += hold;
    rhs += hold.cwiseProduct(node.delta);
  }
  const Eigen::Matrix3d kept =
      (Eigen::Matrix3d::Identity() + predicted.covariance * information).inverse();
  node.mean = kept * (predicted.mean + predicted.covariance * rhs);
  node.covariance = Symmetric(kept * predicted.covariance);
  // The error is kept * (that of the prediction) + by_bias * bias: a bias moves the fixes, and they
  // the mean.
  const Eigen::Matrix3d by_bias = node.covariance * node.rhs_by_bias / misfit;
  const Eigen::Matrix3d part =
      kept * predicted.bias.covariance + by_bias * predicted.bias.cross.transpose();
  node.bias.cross = kept * predicted.bias.cross + by_bias;
  node.bias.covariance = Symmetric(part * kept.transpose() + node.bias.cross * by_bias.transpose());
}

ChainSolver::SystematicState ChainSolver::PredictSystematic(const KeyframeWindow& window,
                                                            std::size_t i) const {
  if (i == 0) {
    const SystematicEffect effect = window.prior ? window.prior->systematic : SystematicEffect();
    return {effect, window.systematic.before_window};
  }
  const Eigen::Vector3d& arm = nodes_[i].motion.arm;
  SystematicState predicted = systematic_[i - 1].state;
  const SystematicEffect before = predicted.effect;
  predicted.effect.by_errors += arm * before.by_errors.row(2);
  predicted.effect.by_errors.rightCols<3>() += systematic_[i].motion_by_odometry;
  predicted.effect.bias_cross += before.bias_cross.col(2) * arm.transpose();
  predicted.known.bias_cross *= nodes_[i].bias_kept;
  return predicted;
}

/// What the fixes pull at the predicted pose, less what the pose gives way, is left for the
/// systematic errors: the Schur complement of all poses until here. The pose is corrected before.
void ChainSolver::CorrectSystematic(const KeyframeWindow& window,
                                    const FixWeighting& weighting,
                                    const Prediction& predicted,
                                    std::size_t i) {
  const SystematicState before = PredictSystematic(window, i);
  const Node& node = nodes_[i];
  const FixesByCamera& fixes = systematic_[i].fixes;
  SystematicState& state = systematic_[i].state;
  state = before;
  if (!node.has_fixes) return;
  const double misfit = weighting.misfit();
  const Eigen::Matrix3d information = node.information / misfit;
  const Eigen::Matrix3d kept = Eigen::Matrix3d::Identity() - node.covariance * information;
  const ByCamera rhs_by_camera = fixes.pose_rhs_by_camera / misfit;
  const BySystematic& by_errors = before.effect.by_errors;
  BySystematic after = kept * by_errors;
  after.leftCols<2>() += node.covariance * rhs_by_camera;
  state.effect.by_errors = after;
  BySystematic pulled = information * by_errors;
  pulled.leftCols<2>() -= rhs_by_camera;
  state.known.information += after.transpose() * pulled;
  state.known.information.topRows<2>() -= rhs_by_camera.transpose() * by_errors;
  state.known.information.topLeftCorner<2, 2>() += fixes.information / misfit;
  state.known.rhs += after.transpose() * (node.rhs / misfit - information * predicted.mean);
  state.known.rhs.head<2>() += fixes.rhs / misfit + rhs_by_camera.transpose() * predicted.mean;

  // The error of the rhs is that before + by_pose * (that of the prediction) + by_now * bias.
  using ByPose = Eigen::Matrix<double, 5, 3>;
  ByPose by_pose = -after.transpose() * information;
  by_pose.topRows<2>() += rhs_by_camera.transpose();
  ByPose by_now = after.transpose() * node.rhs_by_bias / misfit;
  by_now.topRows<2>() += fixes.rhs_by_bias / misfit;
  const FixBiasEffect& bias = predicted.bias;
  const ByPose with_pose =
      before.effect.bias_cross + by_pose * bias.covariance + by_now * bias.cross.transpose();
  const ByPose with_bias = before.known.bias_cross + by_pose * bias.cross;
  const SystematicMatrix mixed =
      with_bias * by_now.transpose() + before.effect.bias_cross * by_pose.transpose();
  state.known.bias_covariance += by_pose * bias.covariance * by_pose.transpose() +
                                 by_now * by_now.transpose() + mixed + mixed.transpose();
  state.known.bias_cross = with_bias + by_now;
  const Eigen::Matrix3d by_bias = node.covariance * node.rhs_by_bias / misfit;
  state.effect.bias_cross =
      with_pose * kept.transpose() + state.known.bias_cross * by_bias.transpose();
}

void ChainSolver::Eliminate(const KeyframeWindow& window,
                            const FixWeighting& weighting,
                            double damping,
                            std::size_t end) {
  const bool is_sought = window.systematic.IsSought();
  for (std::size_t i = std::min(first_dirty_, first_systematic_dirty_); i < end; ++i) {
    const Prediction predicted = i == 0 ? FromPrior(window) : Predict(i);
    Correct(predicted, weighting.misfit(), damping, nodes_[i]);
    if (is_sought && i >= first_systematic_dirty_) {
      CorrectSystematic(window, weighting, predicted, i);
    }
  }
  first_dirty_ = std::max(first_dirty_, end);
  first_systematic_dirty_ = std::max(first_systematic_dirty_, end);
}

ChainSolver::Step ChainSolver::Substitute(std::size_t first_new) {
  Step step;
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    Node& node = nodes_[i];
    const bool is_newest = i + 1 == nodes_.size();
    Eigen::Vector3d delta = node.mean;
    if (!is_newest) {
      const Eigen::Vector3d& after = nodes_[i + 1].delta;
      if (i < first_new && IsLeast(after - node.delta_after)) break;
      node.delta_after = after;
      delta = node.offset + node.gain * after;
    }
    const Eigen::Vector3d change = delta - node.delta;
    step.length_m = std::max(step.length_m, change.head<2>().lpNorm<Eigen::Infinity>());
    step.turn_rad = std::max(step.turn_rad, std::abs(change.z()));
    node.delta = delta;
  }
  return step;
}

void ChainSolver::WriteEstimates(KeyframeWindow& window) const {
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    window.keyframes[i].x_WK = nodes_[i].estimate();
}

void ChainSolver::RestoreDeltas() {
  for (Node& node : nodes_)
    node.delta = node.delta_before_step;
}

bool ChainSolver::AreFinite() const {
  return nodes_.back().covariance.allFinite() &&
         std::all_of(
             nodes_.begin(), nodes_.end(), [](const Node& node) { return node.delta.allFinite(); });
}

double ChainSolver::Cost(KeyframeWindow& window, const FixWeighting& weighting) const {
  const Prediction prior = FromPrior(window);
  const Eigen::Vector3d error = nodes_.front().delta - prior.mean;
  double cost = error.dot(prior.covariance.inverse() * error);
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const Eigen::Vector3d motion =
        nodes_[i].residual.Linearize(nodes_[i - 1].estimate(), nodes_[i].estimate()).error;
    cost += motion.dot(nodes_[i].residual.covariance().inverse() * motion);
  }
  const double scale = weighting.KernelScale() * weighting.KernelScale();
  for (const AttachedFix& fix : window.fixes) {
    const Node& node = nodes_[static_cast<std::size_t>(fix.keyframe_id - nodes_.front().id)];
    const Eigen::Vector3d at = fix.residual.Linearize(node.estimate()).error;
    const double squared = at.dot(fix.residual.information() * at);
    cost += weighting.BaseWeight(fix) / weighting.misfit() * scale * std::log1p(squared / scale);
  }
  return cost;
}

bool ChainSolver::IterateUndamped(KeyframeWindow& window,
                                  const FixWeighting& weighting,
                                  int max_iterations) {
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Linearize(window, weighting);
    if (first_dirty_ >= nodes_.size()) return true;
    const std::size_t first_new = first_dirty_;
    Eliminate(window, weighting, 0.0, nodes_.size());
    for (Node& node : nodes_)
      node.delta_before_step = node.delta;
    const Step step = Substitute(first_new);
    if (!AreFinite()) return false;
    if (step.turn_rad > kDoubtfulTurn) {
      const double after = Cost(window, weighting);
      for (Node& node : nodes_)
        node.delta.swap(node.delta_before_step);
      const double before = Cost(window, weighting);
      if (!(after <= before)) return IterateDamped(window, weighting, 3 * max_iterations);
      for (Node& node : nodes_)
        node.delta.swap(node.delta_before_step);
    }
    if (step.length_m < kSettledLength && step.turn_rad < kSettledTurn) return true;
  }
  return true;
}

bool ChainSolver::IterateDamped(KeyframeWindow& window,
                                const FixWeighting& weighting,
                                int max_iterations) {
  constexpr double kFactor = 10.0;
  constexpr double kMostDamping = 1e8;
  double damping = 1.0;
  double cost = Cost(window, weighting);
  for (int iteration = 0; iteration < max_iterations && damping < kMostDamping;) {
    for (Node& node : nodes_) {
      node.is_motion_new = true;
      node.are_fixes_new = true;
      node.delta_before_step = node.delta;
    }
    Linearize(window, weighting);
    first_dirty_ = 0;
    Eliminate(window, weighting, damping, nodes_.size());
    const Step step = Substitute(nodes_.size());
    const double after = AreFinite() ? Cost(window, weighting) : cost;
    const bool is_lower = after < cost;
    if (is_lower) {
      cost = after;
      damping /= kFactor;
      ++iteration;
      if (step.length_m < kSettledLength && step.turn_rad < kSettledTurn) break;
    } else {
      RestoreDeltas();
      damping *= kFactor;
    }
  }
  // The covariances without the damping, at the estimates that were reached.
  Linearize(window, weighting);
  first_dirty_ = 0;
  first_systematic_dirty_ = 0;
  Eliminate(window, weighting, 0.0, nodes_.size());
  first_dirty_ = 0;  // the estimates are not those of this elimination
  return AreFinite();
}

bool ChainSolver::Solve(KeyframeWindow& window, const FixWeighting& weighting, int max_iterations) {
  Synchronize(window, weighting);
  if (weighting.misfit() != misfit_) {
    misfit_ = weighting.misfit();
    first_dirty_ = 0;
  }
  if (!IterateUndamped(window, weighting, max_iterations)) {
    Invalidate();
    return false;
  }
  WriteEstimates(window);
  return true;
}

bool ChainSolver::EstimateSystematicErrors(KeyframeWindow& window,
                                           const FixWeighting& weighting,
                                           std::size_t keyframes) {
  if (!window.systematic.IsSought()) return true;
  const std::size_t end = std::min(next_systematic_ + keyframes, nodes_.size());
  for (; next_systematic_ < end; ++next_systematic_) {
    const std::size_t i = next_systematic_;
    CorrectSystematic(window, weighting, i == 0 ? FromPrior(window) : Predict(i), i);
  }
  if (next_systematic_ < nodes_.size()) return true;
  next_systematic_ = 0;
  return !TakeSystematicErrors(window, weighting) || Solve(window, weighting, 2);
}

bool ChainSolver::TakeSystematicErrors(KeyframeWindow& window, const FixWeighting& weighting) {
  SystematicErrors& systematic = window.systematic;
  const SystematicKnowledge& known = systematic_.back().state.known;
  const SystematicMatrix posterior =
      SystematicPosterior(systematic.prior_sigmas, known.information);
  systematic.covariance = SystematicCovariance(posterior, known, weighting);
  const SystematicVector before = systematic.estimate;
  const SystematicVector estimate = posterior * (known.rhs + known.information * before);
  const SystematicVector least = kLeastSystematicChange * systematic.Sigmas();
  if (((estimate - before).array().abs() <= least.array()).all()) return false;
  window.SetSystematicErrors(estimate);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    SystematicKnowledge& there = systematic_[i].state.known;
    there.rhs -= there.information * (estimate - before);
    nodes_[i].are_fixes_new = nodes_[i].are_fixes_new || systematic.IsCameraSought();
    if (i > 0) TakeMotion(window.keyframes[i], i);
  }
  first_dirty_ = 0;
  return true;
}

Eigen::Matrix3d ChainSolver::NewestCovariance(const KeyframeWindow& window,
                                              const FixWeighting& weighting) const {
  const Node& newest = nodes_.back();
  Eigen::Matrix3d covariance =
      newest.covariance + weighting.BiasVariance() * newest.bias.covariance;
  if (window.systematic.IsSought()) {
    const SystematicState& state = systematic_.back().state;
    const BySystematic& by_errors = state.effect.by_errors;
    const Eigen::Matrix3d mixed =
        weighting.BiasVariance() * by_errors *
        SystematicPosterior(window.systematic.prior_sigmas, state.known.information) *
        state.effect.bias_cross;
    covariance += by_errors * window.systematic.covariance * by_errors.transpose() + mixed +
                  mixed.transpose();
  }
  return AlongMap(covariance, -newest.estimate().z());
}

BySystematic ChainSolver::NewestBySystematicErrors() const {
  return TangentRotation(-nodes_.back().estimate().z()) * systematic_.back().state.effect.by_errors;
}

void ChainSolver::MarginalizeOldest(KeyframeWindow& window, const FixWeighting& weighting) {
  RELOCD_CHECK(window.keyframes.size() > 1, "the newest keyframe must stay");
  Synchronize(window, weighting);
  if (nodes_[0].are_fixes_new) LinearizeFixes(window, weighting, nodes_[0]);
  if (nodes_[1].is_motion_new) LinearizeMotion(1);
  if (std::min(first_dirty_, first_systematic_dirty_) == 0) Eliminate(window, weighting, 0.0, 1);
  const Prediction next = Predict(1);
  const Eigen::Vector3d x_WK = nodes_[1].reference + next.mean;
  window.prior = KeyframePrior{.x_WK = x_WK,
                               .covariance = AlongMap(next.covariance, -x_WK.z()),
                               .bias = next.bias,
                               .systematic = {}};
  if (window.systematic.IsSought()) ForgetSystematic(PredictSystematic(window, 1), window);
  window.PopFront();
}

Eigen::Matrix3d ChainSolver::SmoothedBias::Covariance(const FixBiasEffect& filtered) const {
  // The later biases know of the filter's error only by the bias of this moment (Markov).
  const Eigen::Matrix3d mixed = kept * filtered.cross * cross.transpose();
  return kept * filtered.covariance * kept.transpose() + later + mixed + mixed.transpose();
}

ChainSolver::SmoothedBias ChainSolver::BiasBefore(std::size_t i,
                                                  const SmoothedBias& after,
                                                  const FixWeighting& weighting) const {
  const Node& next = nodes_[i + 1];
  const Eigen::Matrix3d& gain = nodes_[i].gain;
  // As in Correct: the filter's covariance is what the fixes leave of the prediction's.
  const Eigen::Matrix3d next_kept =
      Eigen::Matrix3d::Identity() - next.covariance * next.information / weighting.misfit();
  const Eigen::Matrix3d by_next_bias =
      after.kept * next.covariance * next.rhs_by_bias / weighting.misfit();
  const Eigen::Matrix3d mixed = by_next_bias * after.cross.transpose();
  SmoothedBias bias;
  const Eigen::Matrix3d changed = after.kept * next_kept - Eigen::Matrix3d::Identity();
  bias.kept += gain * next.motion.MoveFromRight(changed);
  bias.later = Symmetric(
      gain * (by_next_bias * by_next_bias.transpose() + after.later + mixed + mixed.transpose()) *
      gain.transpose());
  bias.cross = next.bias_kept * gain * (by_next_bias + after.cross);
  return bias;
}

std::vector<Eigen::Matrix3d> ChainSolver::SmoothedCovariances(KeyframeWindow& window,
                                                              const FixWeighting& weighting) {
  Invalidate();
  Synchronize(window, weighting);
  Linearize(window, weighting);
  Eliminate(window, weighting, 0.0, nodes_.size());
  // Rauch, Tung and Striebel (1965), backwards.
  std::vector<Eigen::Matrix3d> smoothed(nodes_.size());
  std::vector<Eigen::Matrix3d> with_bias(nodes_.size());
  smoothed.back() = nodes_.back().covariance;
  SmoothedBias bias;
  const SystematicKnowledge& known = systematic_.back().state.known;
  window.systematic.covariance = SystematicCovariance(
      SystematicPosterior(window.systematic.prior_sigmas, known.information), known, weighting);
  BySystematic by_errors = systematic_.back().state.effect.by_errors;
  with_bias.back() = smoothed.back() + weighting.BiasVariance() * nodes_.back().bias.covariance +
                     by_errors * window.systematic.covariance * by_errors.transpose();
  for (std::size_t i = nodes_.size() - 1; i-- > 0;) {
    const Prediction predicted = Predict(i + 1);
    const Eigen::Matrix3d& gain = nodes_[i].gain;
    smoothed[i] = Symmetric(nodes_[i].covariance +
                            gain * (smoothed[i + 1] - predicted.covariance) * gain.transpose());
    bias = BiasBefore(i, bias, weighting);
    const SystematicEffect after = PredictSystematic(window, i + 1).effect;
    by_errors = systematic_[i].state.effect.by_errors + gain * (by_errors - after.by_errors);
    with_bias[i] = smoothed[i] + weighting.BiasVariance() * bias.Covariance(nodes_[i].bias) +
                   by_errors * window.systematic.covariance * by_errors.transpose();
  }
  for (std::size_t i = 0; i < with_bias.size(); ++i)
    with_bias[i] = AlongMap(with_bias[i], -nodes_[i].reference.z());
  return with_bias;
}

}  // namespace relocd
