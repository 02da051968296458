#pragma once

#include "geometry/pose2.h"
#include "smoothing/keyframe_window.h"

namespace relocd {

/// By how much, for each metre of the way, the odometry turns and travels less than the body does:
/// of wheels whose radii are not what the config says. Half a percent of difference between the
/// wheels of a car turns it by 15 degrees over a hundred metres, which no random walk explains.
///
/// Estimated from what the window's fixes turned and stretched the chain by, as constants with
/// Gaussian priors about zero, and put right in the odometry that comes. Thread-bound.
class OdometryDrift {
 public:
  /// @param prior_rad_per_m  standard deviation of the turn of any robot; 0 switches it off.
  /// @param prior_scale      likewise of the part that is missing of the travel.
  OdometryDrift(double prior_rad_per_m, double prior_scale)
      : prior_rad_per_m_(prior_rad_per_m),
        prior_scale_(prior_scale),
        sigma_rad_per_m_(prior_rad_per_m),
        sigma_scale_(prior_scale) {}

  /// Puts a motion right: of the body from where it was, A, to where it is.
  [[nodiscard]] Pose2 Correct(const Pose2& X_AB);

  /// What not knowing the drift better adds to the covariance of the motion from one keyframe to
  /// the next, over `way_m`. Without it the chain of a robot with good encoders and poor radii is
  /// too stiff to follow its fixes.
  [[nodiscard]] Eigen::Matrix3d Covariance(double way_m) const;

  /// Puts the motion to a keyframe right by what is known now, in place of what was known when it
  /// was made.
  ///
  /// @param before  the keyframe before it.
  void CorrectAnew(const Keyframe& before, Keyframe& keyframe) const;

  /// Estimates the drift anew. Costs a look at each keyframe.
  ///
  /// @param covariance  of the newest keyframe: how well the window's ends are known.
  void Estimate(const KeyframeWindow& window, const Eigen::Matrix3d& covariance);

  [[nodiscard]] double rad_per_m() const { return rad_per_m_; }
  [[nodiscard]] double scale() const { return scale_; }
  /// What has been put into the motions so far.
  [[nodiscard]] double corrected_turn_rad() const { return corrected_turn_rad_; }
  [[nodiscard]] double corrected_way_m() const { return corrected_way_m_; }

 private:
  double prior_rad_per_m_;
  double prior_scale_;
  double rad_per_m_ = 0.0;
  double scale_ = 0.0;
  double sigma_rad_per_m_;
  double sigma_scale_;
  double corrected_turn_rad_ = 0.0;
  double corrected_way_m_ = 0.0;
};

}  // namespace relocd
