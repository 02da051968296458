#include "smoothing/batch_solver.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>
#include <ceres/problem.h>
#include <ceres/sized_cost_function.h>
#include <ceres/solver.h>

#include "geometry/angle.h"

namespace relocd {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMajor3By2 = Eigen::Matrix<double, 3, 2, Eigen::RowMajor>;

/// A relative pose's residual, as Ceres wants it: with unit variances. The third parameter is what
/// the odometry gets wrong.
class MotionCost final : public ceres::SizedCostFunction<3, 3, 3, 3> {
 public:
  /// @param errors  with which the keyframe's motion has been put right.
  MotionCost(const Keyframe& keyframe, Eigen::Vector3d errors)
      : residual_(keyframe.MotionResidual()),
        weight_(residual_.covariance().inverse().llt().matrixU()),
        errors_(std::move(errors)),
        by_errors_(MotionByOdometryErrors(keyframe.X_PK, keyframe.extent_PK)) {}

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    const auto at = residual_.Linearize(Eigen::Map<const Eigen::Vector3d>(x[0]),
                                        Eigen::Map<const Eigen::Vector3d>(x[1]));
    const Eigen::Vector3d change = Eigen::Map<const Eigen::Vector3d>(x[2]) - errors_;
    Eigen::Map<Eigen::Vector3d> weighted(residual);
    weighted = weight_ * (at.error - by_errors_ * change);
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) Eigen::Map<RowMajor3>{jacobians[0]} = weight_ * at.by_A;
    if (jacobians[1] != nullptr) Eigen::Map<RowMajor3>{jacobians[1]} = weight_ * at.by_B;
    if (jacobians[2] != nullptr) Eigen::Map<RowMajor3>{jacobians[2]} = -weight_ * by_errors_;
    return true;
  }

 private:
  RelativePoseResidual residual_;
  Eigen::Matrix3d weight_;
  Eigen::Vector3d errors_;
  ByOdometry by_errors_;
};

/// A root of an information matrix. Not a Cholesky factor: without a heading it is singular.
Eigen::Matrix3d RootOf(const Eigen::Matrix3d& information) {
  const Eigen::LDLT<Eigen::Matrix3d> factor(information);
  const Eigen::Matrix3d upper = factor.matrixU();
  const Eigen::Vector3d roots = factor.vectorD().cwiseMax(0.0).cwiseSqrt();
  return roots.asDiagonal() * upper *
         Eigen::Matrix3d(factor.transpositionsP() * Eigen::Matrix3d::Identity());
}

/// An absolute pose's residual, likewise.
class FixCost final : public ceres::SizedCostFunction<3, 3> {
 public:
  explicit FixCost(const AbsolutePoseResidual& residual)
      : residual_(residual), weight_(RootOf(residual.information())) {}

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    const auto at = residual_.Linearize(Eigen::Map<const Eigen::Vector3d>(x[0]));
    Eigen::Map<Eigen::Vector3d> weighted(residual);
    weighted = weight_ * at.error;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<RowMajor3>{jacobians[0]} = weight_ * at.by_K;
    }
    return true;
  }

 private:
  AbsolutePoseResidual residual_;
  Eigen::Matrix3d weight_;
};

/// That of a fix by a camera whose errors are estimated.
class CameraFixCost final : public ceres::SizedCostFunction<3, 3, 2> {
 public:
  /// Borrows `fix`, which must outlive it.
  explicit CameraFixCost(const AttachedFix& fix)
      : fix_(fix), weight_(RootOf(fix.residual.information())) {}

  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector3d> x_WK(x[0]);
    const auto at =
        fix_.residual.At(fix_.MotionWith(Eigen::Map<const Eigen::Vector2d>(x[1]))).Linearize(x_WK);
    Eigen::Map<Eigen::Vector3d> weighted(residual);
    weighted = weight_ * at.error;
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) Eigen::Map<RowMajor3>{jacobians[0]} = weight_ * at.by_K;
    if (jacobians[1] != nullptr) {
      Eigen::Map<RowMajor3By2>{jacobians[1]} = weight_ * fix_.ErrorByCamera(x_WK.z());
    }
    return true;
  }

 private:
  const AttachedFix& fix_;
  Eigen::Matrix3d weight_;
};

/// A prior about zero.
template <typename Sigmas>
ceres::CostFunction* MakeErrorPrior(const Sigmas& sigmas) {
  constexpr double kHeldSigma = 1e-9;  // holds what is not to be estimated where it is
  const Eigen::VectorXd held = sigmas.cwiseMax(kHeldSigma);
  return new ceres::NormalPrior(held.cwiseInverse().asDiagonal().toDenseMatrix(),
                                Eigen::VectorXd::Zero(held.size()));
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

ceres::Problem::Options ProblemOptions() {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;
  return options;
}

/// Ceres's problem over a window, which it borrows.
class WindowProblem {
 public:
  WindowProblem(KeyframeWindow& window, const FixWeighting& weighting)
      : cauchy_(weighting.KernelScale()), problem_(ProblemOptions()) {
    Keyframe& oldest = window.keyframes.front();
    const KeyframePrior prior = window.prior.value_or(KeyframePrior::At(
        {.X_WB = oldest.X_WK(), .covariance = kUnknownSigmas.cwiseAbs2().asDiagonal()}));
    AddFix(AbsolutePoseResidual::OfPose(prior.X_WK(), Pose2(), prior.covariance), nullptr, oldest);
    SystematicErrors& systematic = window.systematic;
    double* const camera_errors = systematic.estimate.data();
    double* const odometry_errors = systematic.estimate.data() + 2;
    for (std::size_t i = 1; i < window.keyframes.size(); ++i) {
      const Keyframe& keyframe = window.keyframes[i];
      problem_.AddResidualBlock(new MotionCost(keyframe, OdometryPart(systematic.estimate)),
                                nullptr,
                                window.keyframes[i - 1].x_WK.data(),
                                window.keyframes[i].x_WK.data(),
                                odometry_errors);
    }
    problem_.AddResidualBlock(
        MakeErrorPrior(OdometryPart(systematic.prior_sigmas)), nullptr, odometry_errors);
    if (OdometryPart(systematic.prior_sigmas).isZero()) {
      problem_.SetParameterBlockConstant(odometry_errors);
    }
    const bool is_camera_sought = systematic.IsCameraSought();
    if (is_camera_sought) {
      problem_.AddResidualBlock(
          MakeErrorPrior(CameraPart(systematic.prior_sigmas)), nullptr, camera_errors);
    }
    losses_.reserve(window.fixes.size());
    for (const AttachedFix& fix : window.fixes) {
      if (fix.share <= 0.0) continue;
      losses_.push_back(std::make_unique<ceres::ScaledLoss>(
          &cauchy_, weighting.BaseWeight(fix) / weighting.misfit(), ceres::DO_NOT_TAKE_OWNERSHIP));
      Keyframe& keyframe = window.Get(fix.keyframe_id);
      if (!is_camera_sought) {
        AddFix(fix.residual, losses_.back().get(), keyframe);
        continue;
      }
      problem_.AddResidualBlock(
          new CameraFixCost(fix), losses_.back().get(), keyframe.x_WK.data(), camera_errors);
    }
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
  void AddFix(const AbsolutePoseResidual& residual, ceres::LossFunction* loss, Keyframe& keyframe) {
    problem_.AddResidualBlock(new FixCost(residual), loss, keyframe.x_WK.data());
  }

  ceres::CauchyLoss cauchy_;
  std::vector<std::unique_ptr<ceres::ScaledLoss>> losses_;
  ceres::Problem problem_;
};

}  // namespace

bool SolveBatch(KeyframeWindow& window, const FixWeighting& weighting, int max_iterations) {
  std::vector<Eigen::Vector3d> before;
  before.reserve(window.keyframes.size());
  for (const Keyframe& keyframe : window.keyframes)
    before.push_back(keyframe.x_WK);
  const SystematicVector errors_before = window.systematic.estimate;

  bool usable = WindowProblem(window, weighting).Solve(max_iterations) &&
                window.systematic.estimate.allFinite();
  const SystematicVector errors = std::exchange(window.systematic.estimate, errors_before);
  for (Keyframe& keyframe : window.keyframes) {
    usable = usable && keyframe.x_WK.allFinite();
    keyframe.x_WK.z() = WrapAngle(keyframe.x_WK.z());
  }
  if (usable) {
    window.SetSystematicErrors(errors);
    return true;
  }
  for (std::size_t i = 0; i < before.size(); ++i)
    window.keyframes[i].x_WK = before[i];
  return false;
}

}  // namespace relocd
