#include "smoothing/fix_misfit.h"

#include <gtest/gtest.h>

#include "smoothing/bent_window.h"
#include "support/random.h"

namespace relocd {
namespace {

/// A fix on each of 300 keyframes, whose errors change with every so many of them.
double MisfitOf(int fixes_per_error) {
  TestRandom random(6);
  KeyframeWindow window = MakeBentWindow(300, 6);
  window.fixes.clear();
  Eigen::Vector2d error;
  for (int i = 0; i < 300; ++i) {
    if (i % fixes_per_error == 0) {
      error = {random.Uniform(-1.7, 1.7), random.Uniform(-1.7, 1.7)};  // a sigma of 1
    }
    AttachedFix fix;
    fix.keyframe_id = i;
    fix.fix.time = window.Get(i).time;
    fix.fix.has_heading = false;
    fix.fix.covariance.setIdentity();
    const Eigen::Vector2d p_WM = window.Get(i).X_WK().translation() + error;
    fix.fix.X_WB = Pose2(p_WM.x(), p_WM.y(), 0.0);
    PrepareResidual(fix);
    window.Insert(fix);
  }
  UpdateAllShares(window, 1.0);
  return FixMisfit().Estimate(window, FixWeighting(1.0, 1.0));
}

TEST(FixMisfitTest, RisesWithErrorsThatLast) {
  EXPECT_LT(MisfitOf(1), 3.0);
  EXPECT_GT(MisfitOf(10), 6.0);
}

}  // namespace
}  // namespace relocd
