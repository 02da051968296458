#pragma once

#include <utility>

#include "core/result.h"

namespace relocd {

/// How odometry without a covariance of its own is trusted: variances that grow with time, travel
/// and turn.
struct OdometryNoiseConfig {
  double forward_sigma_m_per_sqrt_m = 0.02;
  double sideways_sigma_m_per_sqrt_m = 0.01;
  double position_sigma_m_per_sqrt_s = 0.01;
  double heading_sigma_rad_per_sqrt_m = 0.0035;
  double heading_sigma_rad_per_sqrt_rad = 0.02;
  double heading_sigma_rad_per_sqrt_s = 0.0007;

  [[nodiscard]] Result<void> Validate() const;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("forward_sigma_m_per_sqrt_m",
          self.forward_sigma_m_per_sqrt_m,
          ">= 0; along the travel, after one metre of it");
    visit("sideways_sigma_m_per_sqrt_m",
          self.sideways_sigma_m_per_sqrt_m,
          ">= 0; across the travel, after one metre of it");
    visit("position_sigma_m_per_sqrt_s",
          self.position_sigma_m_per_sqrt_s,
          "> 0; of both, after one second, moving or not");
    visit(
        "heading_sigma_rad_per_sqrt_m", self.heading_sigma_rad_per_sqrt_m, ">= 0; after one metre");
    visit("heading_sigma_rad_per_sqrt_rad",
          self.heading_sigma_rad_per_sqrt_rad,
          ">= 0; after a turn of one radian");
    visit("heading_sigma_rad_per_sqrt_s",
          self.heading_sigma_rad_per_sqrt_s,
          "> 0; after one second, moving or not");
  }
};

/// The window, what it believes, and when it stops believing.
struct SmootherConfig {
  int window_keyframes = 450;
  double keyframe_distance_m = 1.0;
  double keyframe_angle_rad = 0.15;
  double keyframe_interval_s = 2.0;
  int max_iterations = 2;

  double cauchy_scale_sigmas = 1.0;
  double gate_squared_mahalanobis = 100.0;
  double fix_correlation_time_s = 0.2;
  double fix_bias_sigmas = 0.55;
  double fix_bias_time_s = 10.0;
  double camera_yaw_sigma_rad = 0.0;
  double camera_time_sigma_s = 0.0;
  int max_fixes_per_keyframe = 8;
  double max_fix_age_s = 10.0;
  double max_extrapolation_s = 0.5;
  double default_fix_sigma_m = 7.0;
  double default_fix_heading_sigma_rad = 0.05;
  double odometry_covariance_factor = 1.4;
  double odometry_drift_sigma_rad_per_m = 0.005;
  double odometry_yaw_rate_sigma_rad_per_s = 0.0;
  double odometry_scale_sigma = 0.02;
  OdometryNoiseConfig default_odometry_noise;

  int start_fixes = 3;
  double start_inlier_share = 0.35;
  int relocalization_window = 40;
  double relocalization_spacing_s = 0.25;
  double relocalization_radius_sigmas = 4.3;
  double relocalization_min_radius_m = 0.5;
  double relocalization_inlier_share = 0.6;

  int ok_fixes = 5;
  double ok_sigma_m = 3.0;
  double ok_heading_sigma_rad = 0.2;
  double dead_reckoning_after_s = 2.0;

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    VisitWindowFields(self, visit);
    VisitFixFields(self, visit);
    VisitStatusFields(self, visit);
  }

 private:
  template <typename Self, typename Visitor>
  static void VisitWindowFields(Self& self, Visitor& visit) {
    visit("window_keyframes",
          self.window_keyframes,
          "[2, 5000]; poses kept and re-estimated; with a robust kernel a short window freezes "
          "early mistakes");
    visit("keyframe_distance_m", self.keyframe_distance_m, "> 0; travel between two keyframes");
    visit("keyframe_angle_rad", self.keyframe_angle_rad, "> 0; turn between two keyframes");
    visit("keyframe_interval_s",
          self.keyframe_interval_s,
          "> 0; time between two keyframes of a body that moves at all");
    visit("max_iterations", self.max_iterations, "[1, 100]; of the solver, for each fix");
    visit("odometry_covariance_factor",
          self.odometry_covariance_factor,
          "> 0; multiplies every odometry covariance: above 1 for errors that are not independent");
    visit(
        "odometry_drift_sigma_rad_per_m",
        self.odometry_drift_sigma_rad_per_m,
        ">= 0; of a constant turn that the odometry gets wrong, which is estimated; 0: it is not");
    visit("odometry_yaw_rate_sigma_rad_per_s",
          self.odometry_yaw_rate_sigma_rad_per_s,
          ">= 0; of a constant error of the yaw rate while the body moves, as of a sensor's bias, "
          "likewise");
    visit("odometry_scale_sigma",
          self.odometry_scale_sigma,
          ">= 0; of a constant part of the travel that the odometry misses, likewise");
    visit("default_odometry_noise",
          self.default_odometry_noise,
          "for odometry files without covariances");
  }

  template <typename Self, typename Visitor>
  static void VisitFixFields(Self& self, Visitor& visit) {
    visit("cauchy_scale_sigmas",
          self.cauchy_scale_sigmas,
          "> 0; residual at which a fix has half its weight");
    visit(
        "gate_squared_mahalanobis",
        self.gate_squared_mahalanobis,
        "> 0; squared distance from the prediction, in squared standard deviations, above which a "
        "fix is left out");
    visit("fix_correlation_time_s",
          self.fix_correlation_time_s,
          ">= 0; fixes closer than this share the information of one");
    visit("fix_bias_sigmas",
          self.fix_bias_sigmas,
          ">= 0; of a slowly varying part of the fixes' errors, as a part of them as they are "
          "measured: the reported covariance allows for it");
    visit("fix_bias_time_s", self.fix_bias_time_s, "> 0; after which 1/e of it is left");
    visit("camera_yaw_sigma_rad",
          self.camera_yaw_sigma_rad,
          "[0, 0.5]; by how much the camera may look to the left of where the config has it, which "
          "is "
          "estimated from fixes with a heading; 0: it is not");
    visit("camera_time_sigma_s",
          self.camera_time_sigma_s,
          "[0, 1]; by how much the fixes' times may be late, likewise");
    visit("max_fixes_per_keyframe",
          self.max_fixes_per_keyframe,
          "[1, 1000]; further ones of the same place are not used: they add no information");
    visit("max_fix_age_s",
          self.max_fix_age_s,
          "> 0; older fixes than this against the odometry are refused");
    visit("max_extrapolation_s",
          self.max_extrapolation_s,
          ">= 0; how far a fix may be ahead of the odometry");
    visit("default_fix_sigma_m",
          self.default_fix_sigma_m,
          "> 0; of fixes without covariance, in files");
    visit("default_fix_heading_sigma_rad",
          self.default_fix_heading_sigma_rad,
          "> 0; of fixes without covariance, in files");
    visit("start_fixes", self.start_fixes, "[1, 1000]; that agree, to start without a prior");
    visit("start_inlier_share",
          self.start_inlier_share,
          "(0, 1]; of the fixes so far that must agree, to start without a prior");
    visit(
        "relocalization_window",
        self.relocalization_window,
        "[10, 200]; recent fixes that may overrule the window; below 40 mistaken resets were seen");
    visit("relocalization_spacing_s", self.relocalization_spacing_s, ">= 0; between two of them");
    visit("relocalization_radius_sigmas",
          self.relocalization_radius_sigmas,
          "> 0; a fix farther from a pose does not support it");
    visit("relocalization_min_radius_m",
          self.relocalization_min_radius_m,
          ">= 0; lower limit of that radius, for the drift of the odometry between the fixes");
    visit("relocalization_inlier_share",
          self.relocalization_inlier_share,
          "(0, 1]; of them that must agree on another pose");
  }

  template <typename Self, typename Visitor>
  static void VisitStatusFields(Self& self, Visitor& visit) {
    visit(
        "ok_fixes",
        self.ok_fixes,
        "[1, 1000]; that lie where the pose predicted them, relocalization_spacing_s apart, before "
        "the status is ok");
    visit("ok_sigma_m", self.ok_sigma_m, "> 0; largest position sigma for the status ok");
    visit("ok_heading_sigma_rad",
          self.ok_heading_sigma_rad,
          "> 0; largest heading sigma for the status ok");
    visit("dead_reckoning_after_s",
          self.dead_reckoning_after_s,
          "> 0; without a fix, the status is dead reckoning");
  }
};

}  // namespace relocd
