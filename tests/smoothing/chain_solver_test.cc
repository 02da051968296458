#include "smoothing/chain_solver.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iostream>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smoothing/batch_solver.h"
#include "smoothing/bent_window.h"
#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

/// So wide a kernel is none: the problem is one of least squares.
const FixWeighting kQuadratic(1e6, 0.0);
const FixWeighting kRobust(1.0, 0.0);

double LargestDifference(const KeyframeWindow& a, const KeyframeWindow& b) {
  double largest = 0.0;
  for (const Keyframe& keyframe : a.keyframes) {
    const Eigen::Vector2d difference =
        keyframe.X_WK().translation() - b.Get(keyframe.id).X_WK().translation();
    largest = std::max(largest, difference.norm());
  }
  return largest;
}

/// Grows a window keyframe by keyframe as the smoother does, and gives the solver one fix at a
/// time, of which a share is far off.
class GrowingWindow {
 public:
  GrowingWindow(double outlier_share, unsigned seed)
      : random_(seed), outlier_share_(outlier_share), chain_(64) {}

  void Grow(const FixWeighting& weighting, int max_iterations) {
    const int id =
        window_.keyframes.empty() ? 0 : static_cast<int>(window_.keyframes.back().id) + 1;
    const Pose2 X_PK = Pose2::Exp({0.5, 0.0, 0.15 * std::sin(0.05 * id)});
    X_WK_ = id == 0 ? Pose2(100.0, -20.0, 3.0) : X_WK_ * X_PK;
    const Pose2 measured = X_PK * Error(0.015, 0.008);
    const Pose2 start = id == 0 ? X_WK_ : window_.keyframes.back().X_WK() * measured;
    window_.keyframes.push_back(MakeKeyframe(id, start, measured));
    if (id % 2 == 1) return;
    const bool is_late = id % 10 == 0 && window_.keyframes.size() > 7;
    const std::size_t back = is_late ? 7 : 1;
    const Keyframe& keyframe = window_.keyframes[window_.keyframes.size() - back];
    AttachedFix fix = MakeAttachedFix(keyframe, Pose2(), id % 4 == 0);
    const bool is_outlier = random_.Uniform(0.0, 1.0) < outlier_share_;
    const Pose2 X_WF = truth_.empty() || back == 1 ? X_WK_ * fix.X_KF
                                                   : truth_[truth_.size() - back + 1] * fix.X_KF;
    fix.fix.X_WB = X_WF * (is_outlier ? Error(20.0, 1.0) : Error(0.3, 0.1));
    PrepareResidual(fix);
    window_.Insert(fix);
    chain_.FixesChanged(fix.keyframe_id, UpdateShares(window_, 0.0, fix.keyframe_id));
    EXPECT_TRUE(chain_.Solve(window_, weighting, max_iterations));
  }

  void GrowAndRemember(const FixWeighting& weighting, int max_iterations) {
    Grow(weighting, max_iterations);
    truth_.push_back(X_WK_);
  }

  void Shorten(std::size_t size, const FixWeighting& weighting) {
    while (window_.keyframes.size() > size)
      chain_.MarginalizeOldest(window_, weighting);
  }

  KeyframeWindow& window() { return window_; }
  ChainSolver& chain() { return chain_; }

 private:
  Pose2 Error(double length, double turn) {
    return Pose2::Exp({random_.Uniform(-length, length),
                       random_.Uniform(-length, length),
                       random_.Uniform(-turn, turn)});
  }

  TestRandom random_;
  double outlier_share_;
  ChainSolver chain_;
  KeyframeWindow window_;
  Pose2 X_WK_;
  std::vector<Pose2> truth_;
};

/// The largest distance of any pose from Ceres's optimum, looked for every 20 keyframes.
double LargestDistanceFromCeres(const FixWeighting& weighting,
                                double outlier_share,
                                int max_iterations,
                                unsigned seed) {
  GrowingWindow growing(outlier_share, seed);
  double largest = 0.0;
  for (int i = 0; i < 301; ++i) {
    growing.GrowAndRemember(weighting, max_iterations);
    if (i < 20 || i % 20 != 0) continue;
    KeyframeWindow optimum = growing.window();
    EXPECT_TRUE(SolveBatch(optimum, weighting, 200));
    largest = std::max(largest, LargestDifference(growing.window(), optimum));
  }
  return largest;
}

TEST(ChainSolverTest, AgreesWithCeresWhenTheCostIsQuadratic) {
  for (unsigned seed = 0; seed < 10; ++seed)
    EXPECT_LT(LargestDistanceFromCeres(kQuadratic, 0.0, 2, seed), 2e-3) << seed;
}

/// Each fix moves its window two steps nearer to a minimum that has then moved on.
TEST(ChainSolverTest, StaysNearCeresUnderARobustKernel) {
  double largest = 0.0;
  for (unsigned seed = 0; seed < 10; ++seed)
    largest = std::max(largest, LargestDistanceFromCeres(kRobust, 0.2, 2, seed));
  std::cout << "robust: at most " << 1e3 * largest << " mm from the optimum\n";
  EXPECT_LT(largest, 0.2);  // an inlier errs by up to 0.3 m
}

TEST(ChainSolverTest, FindsTheRobustMinimumWhenItMayIterate) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    GrowingWindow growing(0.2, seed);
    for (int i = 0; i < 200; ++i)
      growing.GrowAndRemember(kRobust, 2);
    growing.chain().Invalidate();
    ASSERT_TRUE(growing.chain().Solve(growing.window(), kRobust, 100));
    KeyframeWindow optimum = growing.window();
    ASSERT_TRUE(SolveBatch(optimum, kRobust, 200));
    EXPECT_LT(LargestDifference(growing.window(), optimum), 5e-3) << seed;
  }
}

/// Fixes that err by a bias as well, of half their sigmas, that changes within some seconds.
const FixWeighting kBiased(1e6, 0.0, {.sigmas = 0.5, .time_s = 4.0});

/// The normal equations of a window, set up as a whole: the information, and by how much a bias of
/// each keyframe's fixes moves the right-hand side.
struct DenseEquations {
  Eigen::MatrixXd information;  ///< The systematic errors are last.
  Eigen::MatrixXd rhs_by_bias;
};

DenseEquations SetUpDense(KeyframeWindow& window) {
  const auto size = static_cast<Eigen::Index>(3 * window.keyframes.size());
  DenseEquations dense{Eigen::MatrixXd::Zero(size + 5, size + 5),
                       Eigen::MatrixXd::Zero(size + 5, size)};
  const SystematicVector sigmas = window.systematic.prior_sigmas.cwiseMax(1e-9);
  dense.information.bottomRightCorner<5, 5>().diagonal() = sigmas.cwiseAbs2().cwiseInverse();
  const auto prior =
      AbsolutePoseResidual::OfPose(window.prior->X_WK(), Pose2(), window.prior->covariance);
  dense.information.topLeftCorner<3, 3>() += prior.information();
  for (Eigen::Index i = 3; i < size; i += 3) {
    const Keyframe& keyframe = window.keyframes[static_cast<std::size_t>(i / 3)];
    const RelativePoseResidual residual = keyframe.MotionResidual();
    const auto at = residual.Linearize(window.Get(keyframe.id - 1).x_WK, keyframe.x_WK);
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3, size + 5);
    jacobian.middleCols<3>(i - 3) = at.by_A;
    jacobian.middleCols<3>(i) = at.by_B;
    jacobian.rightCols<3>() = -MotionByOdometryErrors(keyframe.X_PK, keyframe.extent_PK);
    dense.information += jacobian.transpose() * residual.covariance().inverse() * jacobian;
  }
  for (const AttachedFix& fix : window.fixes) {
    const Eigen::Vector3d& x_WK = window.Get(fix.keyframe_id).x_WK;
    const auto i = static_cast<Eigen::Index>(3 * fix.keyframe_id);
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3, size + 5);
    jacobian.middleCols<3>(i) = fix.residual.Linearize(x_WK).by_K;
    jacobian.middleCols<2>(size) = fix.ErrorByCamera(x_WK.z());
    const Eigen::MatrixXd gradient =
        kQuadratic.BaseWeight(fix) * jacobian.transpose() * fix.residual.information();
    dense.information += gradient * jacobian;
    dense.rhs_by_bias.middleCols<3>(i) += gradient * fix.covariance_root;
  }
  return dense;
}

/// The biases' covariance with each other, keyframe by keyframe.
Eigen::MatrixXd BiasCovariance(const KeyframeWindow& window, const FixWeighting& weighting) {
  const auto size = static_cast<Eigen::Index>(3 * window.keyframes.size());
  Eigen::MatrixXd covariance(size, size);
  for (const Keyframe& a : window.keyframes) {
    for (const Keyframe& b : window.keyframes) {
      const double seconds = std::abs(ToSeconds(a.time - b.time));
      covariance.block<3, 3>(static_cast<Eigen::Index>(3 * a.id),
                             static_cast<Eigen::Index>(3 * b.id)) =
          weighting.BiasVariance() * weighting.BiasKept(seconds) * Eigen::Matrix3d::Identity();
    }
  }
  return covariance;
}

/// The covariances of right perturbations, and of the systematic errors, from the whole window's
/// equations.
struct DenseResult {
  std::vector<Eigen::Matrix3d> covariances;
  SystematicMatrix of_errors;
};

DenseResult SolveDense(KeyframeWindow& window, const FixWeighting& weighting) {
  const DenseEquations dense = SetUpDense(window);
  const Eigen::MatrixXd inverse = dense.information.inverse();
  const Eigen::MatrixXd by_bias = inverse * dense.rhs_by_bias;
  const Eigen::MatrixXd all =
      inverse + by_bias * BiasCovariance(window, weighting) * by_bias.transpose();
  DenseResult result{.covariances = {}, .of_errors = all.bottomRightCorner<5, 5>()};
  for (const Keyframe& keyframe : window.keyframes) {
    Eigen::Matrix3d R_KW = Eigen::Matrix3d::Identity();
    R_KW.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(-keyframe.x_WK.z()).toRotationMatrix();
    const auto i = static_cast<Eigen::Index>(3 * keyframe.id);
    result.covariances.emplace_back(R_KW * all.block<3, 3>(i, i) * R_KW.transpose());
  }
  return result;
}

TEST(ChainSolverTest, CovariancesAreThoseOfTheWholeNormalEquations) {
  for (const FixWeighting& weighting : {kQuadratic, kBiased}) {
    KeyframeWindow window = MakeBentWindow(20, 1);
    ChainSolver chain(20);
    ASSERT_TRUE(chain.Solve(window, weighting, 50));
    const std::vector<Eigen::Matrix3d> expected = SolveDense(window, weighting).covariances;
    // The equations are set up where the last step began, or a keyframe turned by a milliradian.
    const double tolerance = 5e-3 * expected.back().diagonal().maxCoeff();
    EXPECT_THAT(chain.NewestCovariance(window, weighting), IsNear(expected.back(), tolerance));
    const std::vector<Eigen::Matrix3d> smoothed = chain.SmoothedCovariances(window, weighting);
    for (std::size_t i = 0; i < expected.size(); ++i)
      EXPECT_THAT(smoothed[i], IsNear(expected[i], tolerance)) << "keyframe " << i;
  }
}

/// The bent window's fixes are turned and late, and its motions too short and turned: all that is
/// systematic.
KeyframeWindow MakeWindowOfSystematicErrors(int keyframes, unsigned seed) {
  KeyframeWindow window = MakeBentWindow(keyframes, seed);
  window.systematic.prior_sigmas << 0.2, 0.5, 0.05, 0.02, 0.01;
  for (Keyframe& keyframe : window.keyframes) {
    keyframe.extent_PK.driven_s += 0.5 * std::sin(static_cast<double>(keyframe.id));
    keyframe.X_PK = CorrectMotion(keyframe.X_PK,
                                  keyframe.extent_PK,
                                  MotionCorrection::Of(keyframe.extent_PK, {-0.1, 0.02, 0.01}));
  }
  for (AttachedFix& fix : window.fixes) {
    const double speed = 1.0 + 0.1 * static_cast<double>(fix.keyframe_id % 7);
    fix.X_BF_by_camera.col(1) << -speed, 0.0, -0.2;
    if (fix.fix.has_heading) fix.X_BF_by_camera.col(0) << 0.3, -1.0, 1.0;
    fix.fix.X_WB = fix.fix.X_WB * Pose2(-0.25 * speed, 0.0, 0.1);
    PrepareResidual(fix);
  }
  return window;
}

void SolveToTheEnd(KeyframeWindow& window, const FixWeighting& weighting, ChainSolver& chain) {
  for (int i = 0; i < 20; ++i) {
    chain.Invalidate();
    ASSERT_TRUE(chain.Solve(window, weighting, 10));
    ASSERT_TRUE(chain.EstimateSystematicErrors(window, weighting, window.keyframes.size()));
  }
}

TEST(ChainSolverTest, FindsTheSystematicErrorsThatCeresFinds) {
  for (const FixWeighting& weighting : {kQuadratic, kRobust}) {
    KeyframeWindow window = MakeWindowOfSystematicErrors(60, 7);
    KeyframeWindow optimum = window;
    ChainSolver chain(60);
    SolveToTheEnd(window, weighting, chain);
    ASSERT_TRUE(SolveBatch(optimum, weighting, 200));
    // Ceres has the motions' derivatives at the start: a tenth of the way later they are others.
    // And less than 0.03 sigma is no reason for the chain to move all poses.
    const SystematicVector sigmas = window.systematic.Sigmas();
    EXPECT_GT(optimum.systematic.camera_time_s(), 0.1);
    EXPECT_GT(optimum.systematic.odometry_scale(), 0.03);
    EXPECT_LT(sigmas[0], 0.1);
    EXPECT_LT(sigmas[2], 0.03);
    for (int i = 0; i < 5; ++i)
      EXPECT_NEAR(window.systematic.estimate[i], optimum.systematic.estimate[i], 0.11 * sigmas[i])
          << i;
    EXPECT_LT(LargestDifference(window, optimum), 0.02);
  }
}

TEST(ChainSolverTest, TheSystematicErrorsMayBeLookedForInSteps) {
  KeyframeWindow window = MakeWindowOfSystematicErrors(60, 7);
  KeyframeWindow in_steps = window;
  ChainSolver chain(60);
  ChainSolver stepping(60);
  ASSERT_TRUE(chain.Solve(window, kBiased, 10));
  ASSERT_TRUE(stepping.Solve(in_steps, kBiased, 10));
  ASSERT_TRUE(chain.EstimateSystematicErrors(window, kBiased, 60));
  constexpr int kSteps = 9;  // the last one with the rest, of four
  for (int i = 0; i < kSteps; ++i) {
    EXPECT_EQ(in_steps.systematic.estimate, SystematicVector::Zero()) << "after step " << i;
    ASSERT_TRUE(stepping.EstimateSystematicErrors(in_steps, kBiased, 7));
  }
  EXPECT_NE(window.systematic.estimate, SystematicVector::Zero());
  EXPECT_EQ(in_steps.systematic.estimate, window.systematic.estimate);
  EXPECT_EQ(in_steps.systematic.covariance, window.systematic.covariance);
  EXPECT_EQ(in_steps.keyframes.back().x_WK, window.keyframes.back().x_WK);
}

TEST(ChainSolverTest, TheSystematicErrorsCovarianceIsThatOfTheWholeNormalEquations) {
  for (const FixWeighting& weighting : {kQuadratic, kBiased}) {
    KeyframeWindow window = MakeWindowOfSystematicErrors(20, 1);
    ChainSolver chain(20);
    SolveToTheEnd(window, weighting, chain);
    const DenseResult expected = SolveDense(window, weighting);
    EXPECT_THAT(window.systematic.covariance,
                IsNear(expected.of_errors, 5e-3 * expected.of_errors.diagonal().maxCoeff()));
    for (int i = 0; i < 5; ++i) {
      EXPECT_NEAR(window.systematic.covariance(i, i),
                  expected.of_errors(i, i),
                  0.02 * expected.of_errors(i, i))
          << i;
    }
    const double tolerance = 5e-3 * expected.covariances.back().diagonal().maxCoeff();
    EXPECT_THAT(chain.NewestCovariance(window, weighting),
                IsNear(expected.covariances.back(), tolerance));
    if (weighting.BiasVariance() > 0.0) continue;
    const std::vector<Eigen::Matrix3d> smoothed = chain.SmoothedCovariances(window, weighting);
    for (std::size_t i = 0; i < smoothed.size(); ++i)
      EXPECT_THAT(smoothed[i], IsNear(expected.covariances[i], tolerance)) << "keyframe " << i;
  }
}

/// But for the little that is forgotten with each keyframe.
TEST(ChainSolverTest, MarginalizingKeepsWhatIsKnownOfTheSystematicErrors) {
  KeyframeWindow whole = MakeWindowOfSystematicErrors(30, 2);
  KeyframeWindow shortened = MakeWindowOfSystematicErrors(30, 2);
  ChainSolver chain(30);
  ChainSolver other(30);
  SolveToTheEnd(whole, kBiased, chain);
  SolveToTheEnd(shortened, kBiased, other);
  for (int i = 0; i < 20; ++i)
    other.MarginalizeOldest(shortened, kBiased);
  SolveToTheEnd(shortened, kBiased, other);
  const SystematicVector sigmas = whole.systematic.Sigmas();
  const SystematicVector after = shortened.systematic.Sigmas();
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(after[i], sigmas[i], 0.01 * sigmas[i]) << i;
    EXPECT_NEAR(shortened.systematic.estimate[i], whole.systematic.estimate[i], 0.05 * sigmas[i])
        << i;
  }
  EXPECT_THAT(other.NewestCovariance(shortened, kBiased),
              IsNear(chain.NewestCovariance(whole, kBiased), 2e-4));
}

TEST(ChainSolverTest, MarginalizingChangesNeitherEstimateNorCovariance) {
  KeyframeWindow whole = MakeBentWindow(30, 2);
  KeyframeWindow shortened = MakeBentWindow(30, 2);
  ChainSolver chain(30);
  ChainSolver other(30);
  ASSERT_TRUE(chain.Solve(whole, kBiased, 50));
  ASSERT_TRUE(other.Solve(shortened, kBiased, 50));
  for (int i = 0; i < 20; ++i)
    other.MarginalizeOldest(shortened, kBiased);
  EXPECT_EQ(shortened.keyframes.size(), 10U);
  EXPECT_EQ(shortened.fixes.front().keyframe_id, 21);
  other.Invalidate();
  ASSERT_TRUE(other.Solve(shortened, kBiased, 50));
  EXPECT_LT(LargestDifference(shortened, whole), 1e-4);
  EXPECT_THAT(other.NewestCovariance(shortened, kBiased),
              IsNear(chain.NewestCovariance(whole, kBiased), 5e-5));
}

/// At first the filter hardly knows the yaw, and one fix to the side turns its mean by more than
/// half a turn from the estimate, which all fixes make. So far away it must stay.
TEST(ChainSolverTest, MarginalizingKeepsAYawThatIsFarFromTheEstimate) {
  const auto make = [] {
    KeyframeWindow window = MakeBentWindow(60, 2);
    window.prior.reset();
    for (AttachedFix& fix : window.fixes) {
      fix.fix.has_heading = false;
      if (fix.keyframe_id == 3) fix.fix.X_WB = Pose2(0.0, 5.0, 0.0) * fix.fix.X_WB;
      PrepareResidual(fix);
    }
    UpdateAllShares(window, 0.0);
    return window;
  };
  KeyframeWindow whole = make();
  KeyframeWindow shortened = make();
  ChainSolver chain(60);
  ChainSolver other(60);
  ASSERT_TRUE(chain.Solve(whole, kQuadratic, 50));
  ASSERT_TRUE(other.Solve(shortened, kQuadratic, 50));
  double farthest = 0.0;
  for (int i = 0; i < 10; ++i) {
    other.MarginalizeOldest(shortened, kQuadratic);
    other.Invalidate();
    ASSERT_TRUE(other.Solve(shortened, kQuadratic, 50));
    farthest = std::max(farthest,
                        std::abs(shortened.prior->x_WK.z() - shortened.keyframes.front().x_WK.z()));
  }
  EXPECT_GT(farthest, std::numbers::pi);
  EXPECT_LT(LargestDifference(shortened, whole), 1e-3);
}

/// A stiff chain that is held by weak fixes alone: what a rigid shift costs is small beside what
/// bending costs.
KeyframeWindow MakeStiffWindow() {
  KeyframeWindow window = MakeBentWindow(200, 3);
  window.prior.reset();
  for (Keyframe& keyframe : window.keyframes)
    keyframe.covariance_PK = 1e-5 * Eigen::Matrix3d::Identity();
  for (AttachedFix& fix : window.fixes) {
    fix.fix.covariance = 49.0 * Eigen::Matrix3d::Identity();
    PrepareResidual(fix);
  }
  return window;
}

TEST(ChainSolverTest, FindsTheMinimumInAFewIterationsFarFromIt) {
  KeyframeWindow window = MakeStiffWindow();
  KeyframeWindow shifted = MakeStiffWindow();
  for (Keyframe& keyframe : shifted.keyframes)
    keyframe.x_WK += Eigen::Vector3d(30.0, -20.0, 0.0);
  ASSERT_TRUE(SolveBatch(window, kQuadratic, 100));
  ASSERT_TRUE(ChainSolver(200).Solve(shifted, kQuadratic, 3));
  EXPECT_LT(LargestDifference(shifted, window), 2e-3);
}

/// Turned by a right angle, a whole step of Gauss and Newton's is no good.
TEST(ChainSolverTest, ComesDownFromFarAwayInShorterSteps) {
  KeyframeWindow window = MakeBentWindow(100, 4);
  KeyframeWindow turned = MakeBentWindow(100, 4);
  const Pose2 X_turned(5.0, 3.0, 1.5);
  for (Keyframe& keyframe : turned.keyframes) {
    const Pose2 X_WK = X_turned * keyframe.X_WK();
    keyframe.x_WK << X_WK.translation(), keyframe.x_WK.z() + X_turned.yaw();
  }
  ASSERT_TRUE(SolveBatch(window, kQuadratic, 100));
  ASSERT_TRUE(ChainSolver(100).Solve(turned, kQuadratic, 50));
  EXPECT_LT(LargestDifference(turned, window), 2e-3);
}

TEST(ChainSolverTest, KeepsTheEstimatesWhenTheEquationsAreNotFinite) {
  KeyframeWindow window = MakeBentWindow(5, 5);
  window.keyframes[2].X_PK = Pose2(std::nan(""), 0.0, 0.0);
  const Eigen::Vector3d before = window.keyframes.back().x_WK;
  EXPECT_FALSE(ChainSolver(5).Solve(window, kQuadratic, 5));
  EXPECT_EQ(window.keyframes.back().x_WK, before);
}

TEST(ChainSolverTest, AWindowThatSlidesStaysNearOneThatGrows) {
  GrowingWindow whole(0.0, 6);
  GrowingWindow sliding(0.0, 6);
  for (int i = 0; i < 300; ++i) {
    whole.GrowAndRemember(kQuadratic, 2);
    sliding.GrowAndRemember(kQuadratic, 2);
    sliding.Shorten(40, kQuadratic);
  }
  EXPECT_EQ(sliding.window().keyframes.size(), 40U);
  EXPECT_LT(LargestDifference(sliding.window(), whole.window()), 2e-3);
}

}  // namespace
}  // namespace relocd
