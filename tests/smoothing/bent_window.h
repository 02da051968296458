#pragma once

#include <chrono>
#include <utility>

#include <Eigen/Core>

#include "smoothing/keyframe_window.h"
#include "support/random.h"

namespace relocd {

inline Keyframe MakeKeyframe(int i, const Pose2& X_WK, const Pose2& X_PK) {
  Keyframe keyframe;
  keyframe.id = i;
  keyframe.time = MonotonicTime(std::chrono::seconds(i));
  keyframe.SetX_WK(X_WK);
  keyframe.X_PK = X_PK;
  keyframe.extent_PK = MotionExtent::Of(X_PK, 1.0);
  keyframe.covariance_PK << 4e-4, 1e-4, 0.0, 1e-4, 2e-4, 1e-5, 0.0, 1e-5, 1e-4;
  return keyframe;
}

inline AttachedFix MakeAttachedFix(const Keyframe& keyframe, const Pose2& error, bool has_heading) {
  AttachedFix fix;
  fix.keyframe_id = keyframe.id;
  fix.fix.time = keyframe.time;
  fix.fix.has_heading = has_heading;
  fix.fix.covariance = Eigen::Vector3d(0.09, 0.04, 0.01).asDiagonal();
  fix.X_KB = Pose2(0.2, 0.0, 0.01);
  fix.fix.X_WB = keyframe.X_WK() * fix.X_KB * error;
  PrepareResidual(fix);
  return fix;
}

/// A bent chain with a prior and a fix on every third keyframe, all of which err.
inline KeyframeWindow MakeBentWindow(int keyframes, unsigned seed) {
  TestRandom random(seed);
  const auto error = [&random](double size) {
    return Pose2::Exp({random.Uniform(-size, size), random.Uniform(-size, size), 0.1 * size});
  };
  KeyframeWindow window;
  Pose2 X_WK(3.0, 4.0, 3.0);
  window.prior = KeyframePrior::At(
      {.X_WB = X_WK * error(0.3), .covariance = Eigen::Vector3d(0.2, 0.1, 0.01).asDiagonal()});
  for (int i = 0; i < keyframes; ++i) {
    const Pose2 X_PK = Pose2::Exp({0.5, 0.01, 0.1});
    if (i > 0) X_WK = X_WK * X_PK;
    window.keyframes.push_back(MakeKeyframe(i, X_WK, X_PK * error(0.02)));
    if (i % 3 == 0) window.Insert(MakeAttachedFix(window.keyframes.back(), error(0.3), i % 2 == 0));
  }
  UpdateAllShares(window, 0.0);
  return window;
}

}  // namespace relocd
