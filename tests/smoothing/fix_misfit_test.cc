#include "smoothing/fix_misfit.h"

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "smoothing/bent_window.h"
#include "support/random.h"

namespace relocd {
namespace {

/// A fix on each of 300 keyframes, of the covariance given, whose errors are so many times what it
/// says and change with every so many fixes.
FixErrors ErrorsOf(const Eigen::Matrix2d& covariance, double scale, int fixes_per_error) {
  TestRandom random(6);
  KeyframeWindow window = MakeBentWindow(300, 6);
  window.fixes.clear();
  const Eigen::Matrix2d root = covariance.llt().matrixL();
  Eigen::Vector2d error = Eigen::Vector2d::Zero();
  for (int i = 0; i < 300; ++i) {
    if (i % fixes_per_error == 0) {
      const Eigen::Vector2d drawn(random.Normal(1.0), random.Normal(1.0));
      error = scale * root * drawn;
    }
    AttachedFix fix;
    fix.keyframe_id = i;
    fix.fix.time = window.Get(i).time;
    fix.fix.has_heading = false;
    fix.fix.covariance.topLeftCorner<2, 2>() = covariance;
    const Eigen::Vector2d p_WM = window.Get(i).X_WK().translation() + error;
    fix.fix.X_WB = Pose2(p_WM.x(), p_WM.y(), 0.0);
    PrepareResidual(fix);
    window.Insert(fix);
  }
  UpdateAllShares(window, 1.0);
  return FixMisfit().Measure(window, FixWeighting(1.0, 1.0));
}

const Eigen::Matrix2d kRound = Eigen::Matrix2d::Identity();

TEST(FixMisfitTest, RisesWithErrorsThatLast) {
  EXPECT_LT(ErrorsOf(kRound, 1.0, 1).misfit, 3.0);
  EXPECT_GT(ErrorsOf(kRound, 1.0, 10).misfit, 6.0);
}

TEST(FixMisfitTest, ScatterIsTheErrorsVarianceAgainstTheStatedOne) {
  EXPECT_NEAR(ErrorsOf(kRound, 1.0, 1).scatter, 1.0, 0.2);
  EXPECT_NEAR(ErrorsOf(kRound, 0.5, 1).scatter, 0.25, 0.07);
  EXPECT_NEAR(ErrorsOf(kRound, 2.0, 1).scatter, 4.0, 0.8);
}

TEST(FixMisfitTest, FixesThatAreSureInOneDirectionAloneScatterAsTheySay) {
  Eigen::Matrix2d along_the_diagonal;
  along_the_diagonal << 1.0, 0.99, 0.99, 1.0;
  const FixErrors elongated = ErrorsOf(along_the_diagonal, 1.0, 1);
  EXPECT_NEAR(elongated.scatter, ErrorsOf(kRound, 1.0, 1).scatter, 1e-6);
  EXPECT_NEAR(elongated.misfit, ErrorsOf(kRound, 1.0, 1).misfit, 1e-6);
}

}  // namespace
}  // namespace relocd
