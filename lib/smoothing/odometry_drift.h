#pragma once

#include "geometry/pose2.h"
#include "smoothing/keyframe_window.h"

namespace relocd {

/// Standard deviations of what any robot's odometry may get wrong all the time; 0: it does not.
struct OdometryDriftPrior {
  double rad_per_m = 0.0;
  double rad_per_s = 0.0;
  double scale = 0.0;
};

/// By how much the odometry turns less than the body does, for each metre of the way and for each
/// second, and what part of the travel it misses: of wheels whose radii are not what the config
/// says, and of a yaw-rate sensor with a bias. Half a percent of difference between the wheels of a
/// car turns it by 15 degrees over a hundred metres, which no random walk explains.
///
/// Estimated from what the window's fixes turned and stretched the chain by, as constants with
/// Gaussian priors about zero, and put right in the odometry that comes. A window has one turn: it
/// is shared out between metres and seconds as the priors say, which one speed cannot tell apart.
/// Thread-bound.
class OdometryDrift {
 public:
  explicit OdometryDrift(const OdometryDriftPrior& prior);

  /// Puts a motion right: of the body from where it was, A, to where it is.
  [[nodiscard]] Pose2 Correct(const Pose2& X_AB, const MotionExtent& motion);

  /// What not knowing the drift better adds to the covariance of the motion from one keyframe to
  /// the next. Without it the chain of a robot with good encoders and poor radii is too stiff to
  /// follow its fixes.
  [[nodiscard]] Eigen::Matrix3d Covariance(const MotionExtent& motion) const;

  /// Puts the motion to a keyframe right by what is known now, in place of what was known when it
  /// was made.
  ///
  /// @param before  the keyframe before it.
  void CorrectAnew(const Keyframe& before, Keyframe& keyframe) const;

  /// Estimates the drift anew. Costs a look at each keyframe.
  ///
  /// @param covariance  of the newest keyframe: how well the window's ends are known.
  void Estimate(const KeyframeWindow& window, const Eigen::Matrix3d& covariance);

  [[nodiscard]] double rad_per_m() const { return turn_.x(); }
  [[nodiscard]] double rad_per_s() const { return turn_.y(); }
  [[nodiscard]] double scale() const { return scale_; }
  /// What has been put into the motions so far.
  [[nodiscard]] double corrected_turn_rad() const { return corrected_turn_rad_; }
  [[nodiscard]] double corrected_way_m() const { return corrected_way_m_; }

 private:
  [[nodiscard]] double TurnOver(const MotionExtent& motion) const;

  Eigen::Matrix2d prior_turn_covariance_;  ///< Of the turn for each metre and each second.
  double prior_scale_;
  Eigen::Vector2d turn_ = Eigen::Vector2d::Zero();
  Eigen::Matrix2d turn_covariance_;
  double scale_ = 0.0;
  double sigma_scale_;
  double corrected_turn_rad_ = 0.0;
  double corrected_way_m_ = 0.0;
};

}  // namespace relocd
