#include "smoothing/keyframe_window.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "core/check.h"
#include "geometry/angle.h"
#include "smoothing/absolute_pose_residual.h"
#include "smoothing/motion_covariance.h"
#include "smoothing/relative_pose_residual.h"

namespace relocd {
namespace {

/// What is known of a keyframe where there is no prior: nothing, within the size of any map.
const Eigen::Vector3d kUnknownSigmas(1e4, 1e4, 10.0);

Eigen::Matrix3d Symmetric(const Eigen::Matrix3d& matrix) {
  return 0.5 * (matrix + matrix.transpose());
}

/// The rotation by `yaw` of a planar tangent (x, y, yaw).
Eigen::Matrix3d TangentRotation(double yaw) {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  rotation.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(yaw).toRotationMatrix();
  return rotation;
}

/// The motion's covariance joins the fix's: it is small, and taken along the measured axes.
Eigen::Matrix3d TotalCovariance(const AttachedFix& fix) {
  if (fix.fix.has_heading) return fix.fix.covariance + fix.covariance_KF;
  Eigen::Matrix3d total = fix.fix.covariance;
  total.topLeftCorner<2, 2>() +=
      0.5 * fix.covariance_KF.topLeftCorner<2, 2>().trace() * Eigen::Matrix2d::Identity();
  return total;
}

/// The share of each fix that is news: fixes closer in time than they are independent share the
/// information of one, and those of one keyframe, one place, do not count as more than one.
std::vector<double> IndependentShares(const KeyframeWindow& window, double correlation_time_s) {
  std::vector<double> shares(window.fixes.size(), 0.0);
  std::optional<MonotonicTime> last = window.last_removed_fix;
  std::size_t first_of_keyframe = 0;
  double sum_of_keyframe = 0.0;
  const auto limit_keyframe = [&](std::size_t end) {
    if (sum_of_keyframe > 1.0) {
      for (std::size_t i = first_of_keyframe; i < end; ++i)
        shares[i] /= sum_of_keyframe;
    }
    first_of_keyframe = end;
    sum_of_keyframe = 0.0;
  };
  for (std::size_t i = 0; i < window.fixes.size(); ++i) {
    const AttachedFix& fix = window.fixes[i];
    if (fix.keyframe_id != window.fixes[first_of_keyframe].keyframe_id) limit_keyframe(i);
    if (fix.is_gated) continue;
    const double gap_s = last ? ToSeconds(fix.fix.time - *last) : correlation_time_s;
    shares[i] = gap_s >= correlation_time_s ? 1.0 : std::max(gap_s / correlation_time_s, 1e-3);
    sum_of_keyframe += shares[i];
    last = fix.fix.time;
  }
  limit_keyframe(window.fixes.size());
  return shares;
}

/// Means over Gaussian errors of `dimension`, s the squared length and w(s) the Cauchy weight.
struct KernelMeans {
  double weight = 0.0;        ///< w, what a reweighted least-squares problem shows.
  double slope = 0.0;         ///< w + 2 s w' / dimension, the pull's mean derivative.
  double squared_pull = 0.0;  ///< s w^2.
};

KernelMeans IntegrateKernel(double scale, int dimension) {
  constexpr double kStep = 0.01;
  constexpr double kEnd = 40.0;
  double mass = 0.0;
  KernelMeans sum;
  for (double r = 0.5 * kStep; r * r < kEnd; r += kStep) {
    const double s = r * r;
    const double density = std::pow(r, dimension - 1) * std::exp(-0.5 * s);
    const double weight = 1.0 / (1.0 + s / (scale * scale));
    mass += density;
    sum.weight += density * weight;
    sum.slope += density * (weight - 2.0 * s * weight * weight / (scale * scale * dimension));
    sum.squared_pull += density * s * weight * weight;
  }
  return {sum.weight / mass, sum.slope / mass, sum.squared_pull / mass};
}

/// The weights of good fixes are below one only for the kernel's sake: their information is that of
/// an M-estimator, (mean slope)^2 / (mean squared pull / dimension) (Huber, 1981, section 6).
double KernelCorrection(double scale, int dimension) {
  const KernelMeans means = IntegrateKernel(scale, dimension);
  return means.slope * means.slope * dimension / (means.squared_pull * means.weight);
}

/// A fix, linearised in the right perturbation of its keyframe.
struct LinearizedFix {
  Eigen::Matrix3d information;
  Eigen::Vector3d gradient;
};

/// Linearises fixes as Solve() weights them.
class FixLinearizer {
 public:
  FixLinearizer(const KeyframeWindow& window, const FixWeighting& weighting)
      : window_(window),
        weighting_(weighting),
        shares_(IndependentShares(window, weighting.correlation_time_s())) {}

  /// The sum over the fixes of one keyframe. To be called with rising ids.
  LinearizedFix Sum(const Keyframe& keyframe) {
    LinearizedFix sum{Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero()};
    for (; next_ < window_.fixes.size(); ++next_) {
      const AttachedFix& fix = window_.fixes[next_];
      if (fix.keyframe_id > keyframe.id) break;
      if (fix.keyframe_id < keyframe.id || shares_[next_] <= 0.0) continue;
      Add(keyframe, fix, shares_[next_], sum);
    }
    return sum;
  }

 private:
  void Add(const Keyframe& keyframe,
           const AttachedFix& fix,
           double share,
           LinearizedFix& sum) const {
    const Pose2 X_WF = keyframe.X_WK() * fix.X_KF;
    const Eigen::Matrix3d covariance = TotalCovariance(fix);
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d error = Eigen::Vector3d::Zero();
    error.head<2>() = X_WF.translation() - fix.fix.X_WB.translation();
    Eigen::Matrix3d jacobian = fix.X_KF.Inverse().Adjoint();
    if (fix.fix.has_heading) {
      information = covariance.inverse();
      error.z() = WrapAngle(X_WF.yaw() - fix.fix.X_WB.yaw());
      error = TangentRotation(-fix.fix.X_WB.yaw()) * error;
      jacobian = TangentRotation(X_WF.yaw() - fix.fix.X_WB.yaw()) * jacobian;
    } else {
      information.topLeftCorner<2, 2>() = covariance.topLeftCorner<2, 2>().inverse();
      jacobian = TangentRotation(X_WF.yaw()) * jacobian;
    }
    const double squared = error.dot(information * error);
    const double scale = weighting_.cauchy_scale_sigmas();
    const double weight = share / (1.0 + squared / (scale * scale)) *
                          weighting_.InformationCorrection(fix.fix.has_heading);
    sum.information += weight * jacobian.transpose() * information * jacobian;
    sum.gradient += weight * jacobian.transpose() * information * error;
  }

  const KeyframeWindow& window_;
  FixWeighting weighting_;
  std::vector<double> shares_;
  std::size_t next_ = 0;
};

/// What is known of a keyframe: Gaussian in the right perturbation of its estimate.
struct Belief {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

Belief PriorBelief(const KeyframeWindow& window) {
  const Pose2 X_WK = window.keyframes.front().X_WK();
  if (!window.prior) return {.covariance = kUnknownSigmas.cwiseAbs2().asDiagonal()};
  const Pose2& X_WM = window.prior->X_WB;
  Eigen::Vector3d error;
  error << X_WM.translation() - X_WK.translation(), WrapAngle(X_WM.yaw() - X_WK.yaw());
  const Eigen::Matrix3d rotation = TangentRotation(X_WM.yaw() - X_WK.yaw());
  return {.mean = TangentRotation(-X_WK.yaw()) * error,
          .covariance = Symmetric(rotation * window.prior->covariance * rotation.transpose())};
}

void AddFixes(const LinearizedFix& fixes, Belief& belief) {
  // In covariance form, so that a vague prior does not drown in rounding.
  const Eigen::Matrix3d gain_inverse =
      Eigen::Matrix3d::Identity() + belief.covariance * fixes.information;
  const Eigen::PartialPivLU<Eigen::Matrix3d> lu(gain_inverse);
  belief.mean = lu.solve(belief.mean - belief.covariance * fixes.gradient);
  belief.covariance = Symmetric(lu.solve(belief.covariance));
}

/// What a belief of the keyframe before says of `keyframe`, given the motion between them.
Belief MoveForward(const Belief& before, const Pose2& X_WP, const Keyframe& keyframe) {
  const Pose2 X_WK = keyframe.X_WK();
  const Eigen::Matrix3d adjoint = (X_WK.Inverse() * X_WP).Adjoint();
  const Pose2 predicted = X_WP * keyframe.X_PK;
  Eigen::Vector3d error;
  error << predicted.translation() - X_WK.translation(), WrapAngle(predicted.yaw() - X_WK.yaw());
  const Eigen::Vector3d offset = TangentRotation(-X_WK.yaw()) * error;
  return {.mean = adjoint * before.mean + offset,
          .covariance = Symmetric(adjoint * before.covariance * adjoint.transpose() +
                                  keyframe.covariance_PK)};
}

/// How hard the fixes of one keyframe pull on the estimate, in standard deviations.
struct Pull {
  std::int64_t keyframe_id = 0;
  double time_s = 0.0;
  Eigen::Vector2d pull = Eigen::Vector2d::Zero();
};

struct PullSeries {
  std::vector<Pull> pulls;
  double share_sum = 0.0;  ///< So many independent fixes stand behind them.
};

Eigen::Vector2d WhitenedPositionError(const KeyframeWindow& window, const AttachedFix& fix) {
  return (window.X_WF(fix).translation() - fix.fix.X_WB.translation()) /
         std::sqrt(0.5 * TotalCovariance(fix).topLeftCorner<2, 2>().trace());
}

/// By how much the fixes scatter more than their covariances say, as a variance, at least 1. From
/// the better third of them: more than half may be wrong.
double ScatterFactor(const KeyframeWindow& window) {
  constexpr double kQuantile = 0.3;
  // Of the squared length of a standard normal vector in the plane.
  const double expected = -2.0 * std::log(1.0 - kQuantile);
  constexpr double kWeightOfOne = 10.0;  // in fixes: few of them scatter by chance
  std::vector<double> squared;
  for (const AttachedFix& fix : window.fixes) {
    if (!fix.is_gated) squared.push_back(WhitenedPositionError(window, fix).squaredNorm());
  }
  if (squared.empty()) return 1.0;
  const auto count = static_cast<double>(squared.size());
  const auto chosen = squared.begin() + static_cast<std::ptrdiff_t>(kQuantile * count);
  std::nth_element(squared.begin(), chosen, squared.end());
  return std::max(1.0, (count * *chosen / expected + kWeightOfOne) / (count + kWeightOfOne));
}

PullSeries CollectPulls(const KeyframeWindow& window,
                        const FixWeighting& weighting,
                        double scatter_factor) {
  const std::vector<double> shares = IndependentShares(window, weighting.correlation_time_s());
  const double scale = weighting.cauchy_scale_sigmas();
  PullSeries series;
  for (std::size_t i = 0; i < window.fixes.size(); ++i) {
    if (shares[i] <= 0.0) continue;
    const AttachedFix& fix = window.fixes[i];
    const Eigen::Vector2d whitened = WhitenedPositionError(window, fix) / std::sqrt(scatter_factor);
    const double weight = shares[i] / (1.0 + whitened.squaredNorm() / (scale * scale));
    if (series.pulls.empty() || series.pulls.back().keyframe_id != fix.keyframe_id) {
      series.pulls.push_back(
          {.keyframe_id = fix.keyframe_id, .time_s = ToSeconds(fix.fix.time.time_since_epoch())});
    }
    series.pulls.back().pull += weight * whitened;
    series.share_sum += shares[i];
  }
  return series;
}

ceres::Solver::Options SolverOptions(int max_iterations, double trust_region_radius) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;  // no BLAS, so no threads
  options.num_threads = 1;
  options.max_num_iterations = max_iterations;
  options.initial_trust_region_radius = trust_region_radius;
  options.max_trust_region_radius = std::max(options.max_trust_region_radius, trust_region_radius);
  // The default of 1e-6 stops short: a rigid shift of the whole chain lowers the cost slowly.
  options.function_tolerance = 1e-9;
  options.parameter_tolerance = 1e-10;
  options.max_solver_time_in_seconds = 1e6;  // a limit by the clock would end the bit equality
  options.logging_type = ceres::SILENT;
  return options;
}

/// Ceres's problem over a window, which it borrows.
class WindowProblem {
 public:
  WindowProblem(KeyframeWindow& window, const FixWeighting& weighting)
      : cauchy_(weighting.cauchy_scale_sigmas()), problem_(ProblemOptions()) {
    for (Keyframe& keyframe : window.keyframes) {
      problem_.AddParameterBlock(keyframe.x_WK.data(), 3);
    }
    AddPrior(window);
    for (std::size_t i = 1; i < window.keyframes.size(); ++i) {
      problem_.AddResidualBlock(window.keyframes[i].motion_residual.get(),
                                nullptr,
                                window.keyframes[i - 1].x_WK.data(),
                                window.keyframes[i].x_WK.data());
    }
    AddFixes(window, weighting);
  }

  /// @return whether the result is finite and no worse than before.
  bool Solve(int max_iterations) {
    // With the default radius of 1e4 a rigid shift of the chain is damped: a few iterations then
    // stop metres short of the minimum.
    constexpr double kUndamped = 1e16;
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(max_iterations, kUndamped), &problem_, &summary);
    if (summary.IsSolutionUsable() && summary.termination_type != ceres::CONVERGENCE &&
        summary.num_successful_steps <= 1 && summary.num_unsuccessful_steps > 0) {
      // No whole Gauss-Newton step lowers the cost: short ones do.
      constexpr double kDamped = 1e4;
      ceres::Solve(SolverOptions(3 * max_iterations, kDamped), &problem_, &summary);
    }
    return summary.IsSolutionUsable() && std::isfinite(summary.final_cost);
  }

 private:
  static ceres::Problem::Options ProblemOptions() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    return options;
  }

  void AddPrior(KeyframeWindow& window) {
    Keyframe& oldest = window.keyframes.front();
    const PlanarPose prior = window.prior.value_or(
        PlanarPose{.X_WB = oldest.X_WK(), .covariance = kUnknownSigmas.cwiseAbs2().asDiagonal()});
    prior_ = std::make_unique<AbsolutePoseResidual::CostFunction>(
        new AbsolutePoseResidual(prior.X_WB, Pose2(), prior.covariance));
    problem_.AddResidualBlock(prior_.get(), nullptr, oldest.x_WK.data());
  }

  void AddFixes(KeyframeWindow& window, const FixWeighting& weighting) {
    const std::vector<double> shares = IndependentShares(window, weighting.correlation_time_s());
    losses_.reserve(shares.size());
    for (std::size_t i = 0; i < window.fixes.size(); ++i) {
      AttachedFix& fix = window.fixes[i];
      if (shares[i] <= 0.0) continue;
      losses_.push_back(
          std::make_unique<ceres::ScaledLoss>(&cauchy_, shares[i], ceres::DO_NOT_TAKE_OWNERSHIP));
      problem_.AddResidualBlock(
          fix.residual.get(), losses_.back().get(), window.Get(fix.keyframe_id).x_WK.data());
    }
  }

  ceres::CauchyLoss cauchy_;
  std::vector<std::unique_ptr<ceres::ScaledLoss>> losses_;
  std::unique_ptr<ceres::CostFunction> prior_;
  ceres::Problem problem_;
};

}  // namespace

FixWeighting::FixWeighting(double cauchy_scale_sigmas, double correlation_time_s)
    : cauchy_scale_sigmas_(cauchy_scale_sigmas),
      correlation_time_s_(correlation_time_s),
      correction_with_heading_(KernelCorrection(cauchy_scale_sigmas, 3)),
      correction_without_heading_(KernelCorrection(cauchy_scale_sigmas, 2)),
      expected_squared_pull_(IntegrateKernel(cauchy_scale_sigmas, 2).squared_pull) {}

bool KeyframeWindow::Has(std::int64_t keyframe_id) const {
  return !keyframes.empty() && keyframe_id >= keyframes.front().id &&
         keyframe_id <= keyframes.back().id;
}

Keyframe& KeyframeWindow::Get(std::int64_t keyframe_id) {
  RELOCD_CHECK(Has(keyframe_id), "the keyframe is not in the window");
  return keyframes[static_cast<std::size_t>(keyframe_id - keyframes.front().id)];
}

const Keyframe& KeyframeWindow::Get(std::int64_t keyframe_id) const {
  RELOCD_CHECK(Has(keyframe_id), "the keyframe is not in the window");
  return keyframes[static_cast<std::size_t>(keyframe_id - keyframes.front().id)];
}

Pose2 KeyframeWindow::X_WF(const AttachedFix& fix) const {
  return Get(fix.keyframe_id).X_WK() * fix.X_KF;
}

std::unique_ptr<ceres::CostFunction> MakeFixResidual(const AttachedFix& fix) {
  const Eigen::Matrix3d covariance = TotalCovariance(fix);
  if (fix.fix.has_heading) {
    return std::make_unique<AbsolutePoseResidual::CostFunction>(
        new AbsolutePoseResidual(fix.fix.X_WB, fix.X_KF, covariance));
  }
  return std::make_unique<AbsolutePositionResidual::CostFunction>(new AbsolutePositionResidual(
      fix.fix.X_WB.translation(), fix.X_KF.translation(), covariance.topLeftCorner<2, 2>()));
}

std::unique_ptr<ceres::CostFunction> MakeMotionResidual(const Keyframe& keyframe) {
  return std::make_unique<RelativePoseResidual::CostFunction>(
      new RelativePoseResidual(keyframe.X_PK, keyframe.covariance_PK));
}

bool Solve(KeyframeWindow& window, const FixWeighting& weighting, int max_iterations) {
  std::vector<std::array<double, 3>> before;
  before.reserve(window.keyframes.size());
  for (const Keyframe& keyframe : window.keyframes)
    before.push_back(keyframe.x_WK);

  bool usable = WindowProblem(window, weighting).Solve(max_iterations);
  for (Keyframe& keyframe : window.keyframes) {
    usable = usable && std::all_of(keyframe.x_WK.begin(), keyframe.x_WK.end(), [](double value) {
               return std::isfinite(value);
             });
    keyframe.x_WK[2] = WrapAngle(keyframe.x_WK[2]);
  }
  if (usable) return true;
  for (std::size_t i = 0; i < before.size(); ++i)
    window.keyframes[i].x_WK = before[i];
  return false;
}

double EstimateMisfit(const KeyframeWindow& window, const FixWeighting& weighting) {
  constexpr double kBandwidth = 20.0;  // s; errors were seen to last 3 to 8 s
  constexpr double kUsualMisfit = 8.0;
  constexpr double kUsualWeight = 10.0;  // in fixes
  const double scatter_factor = ScatterFactor(window);
  const PullSeries series = CollectPulls(window, weighting, scatter_factor);
  double squared = 0.0;
  for (std::size_t i = 0; i < series.pulls.size(); ++i) {
    squared += series.pulls[i].pull.squaredNorm();
    for (std::size_t j = i + 1; j < series.pulls.size(); ++j) {
      const double lag = series.pulls[j].time_s - series.pulls[i].time_s;
      if (lag >= kBandwidth) break;
      squared += 2.0 * (1.0 - lag / kBandwidth) * series.pulls[i].pull.dot(series.pulls[j].pull);
    }
  }
  const double misfit = (squared / weighting.ExpectedSquaredPull() + kUsualWeight * kUsualMisfit) /
                        (series.share_sum + kUsualWeight);
  return scatter_factor * std::max(1.0, misfit);
}

Eigen::Matrix3d NewestCovariance(const KeyframeWindow& window, const FixWeighting& weighting) {
  FixLinearizer fixes(window, weighting);
  Belief belief = PriorBelief(window);
  AddFixes(fixes.Sum(window.keyframes.front()), belief);
  for (std::size_t i = 1; i < window.keyframes.size(); ++i) {
    belief = MoveForward(belief, window.keyframes[i - 1].X_WK(), window.keyframes[i]);
    AddFixes(fixes.Sum(window.keyframes[i]), belief);
  }
  return belief.covariance;
}

std::vector<Eigen::Matrix3d> SmoothedCovariances(const KeyframeWindow& window,
                                                 const FixWeighting& weighting) {
  FixLinearizer linearizer(window, weighting);
  std::vector<LinearizedFix> fixes;
  std::vector<Eigen::Matrix3d> filtered;
  Belief belief = PriorBelief(window);
  for (std::size_t i = 0; i < window.keyframes.size(); ++i) {
    const Keyframe& keyframe = window.keyframes[i];
    if (i > 0) belief = MoveForward(belief, window.keyframes[i - 1].X_WK(), keyframe);
    fixes.push_back(linearizer.Sum(keyframe));
    AddFixes(fixes.back(), belief);
    filtered.push_back(belief.covariance);
  }
  // Backwards: what the keyframes from i + 1 on say of i, and the two beliefs joined.
  std::vector<Eigen::Matrix3d> smoothed(filtered.size());
  Belief after{.covariance = kUnknownSigmas.cwiseAbs2().asDiagonal()};
  for (std::size_t i = filtered.size(); i-- > 0;) {
    smoothed[i] = Symmetric((filtered[i].inverse() + after.covariance.inverse()).inverse());
    if (i == 0) break;
    AddFixes(fixes[i], after);
    const Eigen::Matrix3d adjoint =
        (window.keyframes[i - 1].X_WK().Inverse() * window.keyframes[i].X_WK()).Adjoint();
    after.covariance = Symmetric(adjoint * (after.covariance + window.keyframes[i].covariance_PK) *
                                 adjoint.transpose());
  }
  return smoothed;
}

RemovedKeyframe MarginalizeOldest(KeyframeWindow& window, const FixWeighting& weighting) {
  RELOCD_CHECK(window.keyframes.size() > 1, "the newest keyframe must stay");
  FixLinearizer fixes(window, weighting);
  Belief belief = PriorBelief(window);
  AddFixes(fixes.Sum(window.keyframes.front()), belief);
  const Keyframe& next = window.keyframes[1];
  belief = MoveForward(belief, window.keyframes.front().X_WK(), next);
  const Pose2 X_WK = next.X_WK();
  const Eigen::Vector2d p_WM = X_WK * Eigen::Vector2d(belief.mean.head<2>());
  const Pose2 X_WM(p_WM.x(), p_WM.y(), X_WK.yaw() + belief.mean.z());
  const Eigen::Matrix3d rotation = TangentRotation(-belief.mean.z());

  RemovedKeyframe removed;
  removed.keyframe = std::move(window.keyframes.front());
  window.keyframes.pop_front();
  window.prior = PlanarPose{
      .X_WB = X_WM, .covariance = Symmetric(rotation * belief.covariance * rotation.transpose())};
  while (!window.fixes.empty() && window.fixes.front().keyframe_id <= removed.keyframe.id) {
    if (!window.fixes.front().is_gated) window.last_removed_fix = window.fixes.front().fix.time;
    removed.fixes.push_back(std::move(window.fixes.front()));
    window.fixes.pop_front();
  }
  return removed;
}

}  // namespace relocd
