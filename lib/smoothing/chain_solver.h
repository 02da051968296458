#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "geometry/planar.h"
#include "smoothing/keyframe_window.h"
#include "smoothing/relative_pose_residual.h"
#include "smoothing/sliding_vector.h"

namespace relocd {

/// Finds the most likely poses of a window's keyframes, again and again as the window grows, and
/// does only what has changed.
///
/// The keyframes are a chain, so the normal equations are block-tridiagonal, and are eliminated
/// from the oldest keyframe on: a filter in blocks of 3x3, whose state at each keyframe is kept. A
/// new fix on the newest keyframe costs one step of it. Then the poses are taken back to front, and
/// no further than they move. What is linearised anew is the motion from a keyframe that has turned
/// (a shift changes nothing, since the residuals are linear in it), and the fixes of one that has
/// moved by a hundredth of their sigma, whose weights under the kernel change.
///
/// Covariances are carried instead of information: a vague prior next to a stiff chain loses no
/// digits. Fixes are weighted as if they erred independently; what a bias that lasts does to these
/// estimates is carried along and added to their covariances (a filter that "considers" it:
/// Schmidt, 1966). How the systematic errors of camera and odometry move them is carried along too,
/// and what that tells of those errors (a bias beside a filter: Friedland, 1969). Allocates nothing
/// once it has seen its largest window. Thread-bound.
class ChainSolver {
 public:
  /// @param capacity  the most keyframes that there will be without an allocation.
  explicit ChainSolver(std::size_t capacity);

  /// All is to be linearised anew: the estimates were changed by somebody else.
  void Invalidate();
  /// The fixes of these keyframes, or their shares, have changed.
  void FixesChanged(std::int64_t first_id, std::int64_t last_id);

  /// Moves the window's estimates to the minimum, nearer by at most `max_iterations` steps. The
  /// shares of the fixes must be set.
  ///
  /// Gauss and Newton's step; where that would turn a keyframe far and not lower the cost, damped
  /// ones. The systematic errors stay. The same calls give the same bits.
  ///
  /// @return whether the estimates are finite; if not, they are as before.
  bool Solve(KeyframeWindow& window, const FixWeighting& weighting, int max_iterations);

  /// Looks at up to so many keyframes more, from the oldest on, for what they say of the systematic
  /// errors. Come to the newest, estimates the errors from all that the window knows, moves the
  /// poses with them where that is worth it, and begins at the oldest again.
  ///
  /// To be called after Solve. @return as Solve.
  bool EstimateSystematicErrors(KeyframeWindow& window,
                                const FixWeighting& weighting,
                                std::size_t keyframes);

  /// The covariance of the newest keyframe's right perturbation given all in the window, as of the
  /// last Solve: the last block of the elimination, and what the fixes' bias and the
  /// systematic errors add.
  [[nodiscard]] Eigen::Matrix3d NewestCovariance(const KeyframeWindow& window,
                                                 const FixWeighting& weighting) const;

  /// The derivative of the newest keyframe's right perturbation by the systematic errors.
  [[nodiscard]] BySystematic NewestBySystematicErrors() const;

  /// Takes the oldest keyframe and its fixes out of the window, and leaves what they say of the
  /// next one as its prior. The window must have two keyframes.
  void MarginalizeOldest(KeyframeWindow& window, const FixWeighting& weighting);

  /// The covariances of all keyframes' right perturbations given all in the window, at the window's
  /// estimates; and that of the systematic errors, written into the window.
  std::vector<Eigen::Matrix3d> SmoothedCovariances(KeyframeWindow& window,
                                                   const FixWeighting& weighting);

 private:
  /// A motion along W's axes: delta = delta of the node before + arm * its yaw + offset + noise.
  struct LinearMotion {
    Eigen::Vector3d arm = Eigen::Vector3d::Zero();  ///< How a turn before moves the node; no yaw.
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();

    /// (The derivative by the node before) * matrix, and that * its transpose.
    [[nodiscard]] Eigen::Matrix3d Move(const Eigen::Matrix3d& matrix) const {
      return matrix + arm * matrix.row(2);
    }
    /// matrix * (the derivative by the node before).
    [[nodiscard]] Eigen::Matrix3d MoveFromRight(Eigen::Matrix3d matrix) const {
      matrix.col(2) += Eigen::Vector3d(matrix * arm);
      return matrix;
    }
    [[nodiscard]] Eigen::Matrix3d MoveBoth(const Eigen::Matrix3d& symmetric) const {
      const Eigen::Matrix3d moved = Move(symmetric);
      return moved + moved.col(2) * arm.transpose();
    }
  };

  /// A keyframe's part of the equations. Its estimate is reference + delta.
  struct Node {
    // What each fix looks at in all nodes stands first, together in the cache.
    std::int64_t id = 0;
    Eigen::Vector3d reference = Eigen::Vector3d::Zero();
    Eigen::Vector3d delta = Eigen::Vector3d::Zero();
    Eigen::Vector3d delta_before_step = Eigen::Vector3d::Zero();
    Eigen::Vector3d weighted_at = Eigen::Vector3d::Zero();
    double largest_information_m = 0.0;
    double largest_information_rad = 0.0;
    double motion_yaw = 0.0;  ///< Of the node before, where its motion is linearised.
    bool has_fixes = false;
    bool is_motion_new = true;
    bool are_fixes_new = true;

    /// The motion from the node before.
    LinearMotion motion;
    double bias_kept = 0.0;  ///< Of a bias of the fixes, since the node before.

    /// The fixes: information * delta = rhs, without the misfit.
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
    Eigen::Matrix3d rhs_by_bias = Eigen::Matrix3d::Zero();

    /// What is known of the delta from here and before.
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    FixBiasEffect bias;  ///< On the mean.
    /// delta = offset + gain * delta of the node after, for which it was last taken.
    Eigen::Matrix3d gain = Eigen::Matrix3d::Zero();
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();
    Eigen::Vector3d delta_after = Eigen::Vector3d::Zero();

    RelativePoseResidual residual;

    [[nodiscard]] Eigen::Vector3d estimate() const { return reference + delta; }
  };

  struct Prediction {
    Eigen::Vector3d mean;
    Eigen::Matrix3d covariance;
    FixBiasEffect bias;
  };

  /// What is known of the systematic errors from a keyframe and those before it, and what they do
  /// to the keyframe's mean.
  struct SystematicState {
    SystematicEffect effect;
    SystematicKnowledge known;
  };

  /// What a keyframe's fixes say of the camera's errors, without the misfit: with the keyframe as
  /// it is, information * errors = rhs.
  struct FixesByCamera {
    ByCamera pose_rhs_by_camera = ByCamera::Zero();
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    Eigen::Vector2d rhs = Eigen::Vector2d::Zero();
    Eigen::Matrix<double, 2, 3> rhs_by_bias = Eigen::Matrix<double, 2, 3>::Zero();
  };

  /// A keyframe's part of the equations that concerns the systematic errors, apart from the node:
  /// what each fix looks at in all nodes is nearer together in the cache.
  struct SystematicNode {
    /// Of the motion from the node before, along that node's axes and along W's.
    ByOdometry motion_P_by_odometry = ByOdometry::Zero();
    ByOdometry motion_by_odometry = ByOdometry::Zero();
    FixesByCamera fixes;  ///< Zero where the camera's errors are not sought.

    SystematicState state;
  };

  /// The largest changes of one step.
  struct Step {
    double length_m = 0.0;
    double turn_rad = 0.0;
  };

  /// What the fixes' bias makes of a keyframe's estimate that later fixes have a part in: the error
  /// is `kept` times that of the filter's mean, and a part that later biases make.
  struct SmoothedBias {
    Eigen::Matrix3d kept = Eigen::Matrix3d::Identity();
    Eigen::Matrix3d later = Eigen::Matrix3d::Zero();  ///< Covariance of the later part.
    Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();  ///< Of it with the bias of this moment.

    [[nodiscard]] Eigen::Matrix3d Covariance(const FixBiasEffect& filtered) const;
  };
  /// That of node i, from that of the node after it.
  [[nodiscard]] SmoothedBias BiasBefore(std::size_t i,
                                        const SmoothedBias& after,
                                        const FixWeighting& weighting) const;

  void Synchronize(const KeyframeWindow& window, const FixWeighting& weighting);
  /// The motion to a node is the keyframe's.
  void TakeMotion(const Keyframe& keyframe, std::size_t i);
  void Linearize(KeyframeWindow& window, const FixWeighting& weighting);
  void LinearizeMotion(std::size_t i);
  void LinearizeFixes(KeyframeWindow& window, const FixWeighting& weighting, Node& node);

  [[nodiscard]] Prediction FromPrior(const KeyframeWindow& window) const;
  /// What the node before says of node i; keeps in it what leads back.
  Prediction Predict(std::size_t i);
  static void Correct(const Prediction& predicted, double misfit, double damping, Node& node);
  void Eliminate(const KeyframeWindow& window,
                 const FixWeighting& weighting,
                 double damping,
                 std::size_t end);
  Step Substitute(std::size_t first_new);
  [[nodiscard]] SystematicState PredictSystematic(const KeyframeWindow& window,
                                                  std::size_t i) const;
  void CorrectSystematic(const KeyframeWindow& window,
                         const FixWeighting& weighting,
                         const Prediction& predicted,
                         std::size_t i);
  /// @return whether they differ from the estimate by enough to move the poses with them.
  bool TakeSystematicErrors(KeyframeWindow& window, const FixWeighting& weighting);
  static void ForgetSystematic(const SystematicState& next, KeyframeWindow& window);
  void WriteEstimates(KeyframeWindow& window) const;

  bool IterateUndamped(KeyframeWindow& window, const FixWeighting& weighting, int max_iterations);
  bool IterateDamped(KeyframeWindow& window, const FixWeighting& weighting, int max_iterations);
  void RestoreDeltas();
  [[nodiscard]] double Cost(KeyframeWindow& window, const FixWeighting& weighting) const;
  [[nodiscard]] bool AreFinite() const;

  SlidingVector<Node> nodes_;
  SlidingVector<SystematicNode> systematic_;  ///< Of the same keyframes.
  std::size_t first_dirty_ = 0;               ///< From here on the elimination is to be done again.
  /// From here on fixes are new to what is known of the systematic errors.
  std::size_t first_systematic_dirty_ = 0;
  std::size_t next_systematic_ = 0;  ///< That EstimateSystematicErrors looks at.
  double misfit_ = 0.0;              ///< Of the elimination.
};

}  // namespace relocd
