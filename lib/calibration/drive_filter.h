#pragma once

#include <vector>

#include <Eigen/Core>

#include "calibration/odometry_recording.h"
#include "geometry/pose2.h"

namespace relocd {

/// Where a reference (R, fixed to the body) was.
struct ReferencePose {
  double time_s = 0.0;  ///< Since the recording's origin, on the reference's clock.
  Pose2 X_WR;
  bool has_heading = true;
};

/// What tells how the body turns.
enum class TurnSource { kWheels, kYawRate, kSteering };

/// What a calibration finds.
struct DriveParameters {
  double left_scale = 1.0;  ///< Of the recorded travel.
  double right_scale = 1.0;
  double track_m = 1.5;
  double wheelbase_m = 2.7;
  double steering_ratio = 1.0;
  double steering_offset_rad = 0.0;
  double yaw_rate_scale = 1.0;
  double yaw_rate_bias_radps = 0.0;
  double time_offset_s = 0.0;  ///< The CAN bus's time less the reference's.
  double mount_x_m = 0.0;      ///< X_BR.
  double mount_y_m = 0.0;
  double mount_yaw_rad = 0.0;
};

/// How well odometry and reference measure. The first five are odometry's config.
struct DriveNoise {
  double wheel_sigma_m_per_sqrt_m = 0.01;
  double lateral_sigma_m_per_sqrt_m = 0.005;
  double turn_sigma_rad_per_sqrt_rad = 0.02;
  double yaw_rate_noise_rad_per_sqrt_s = 0.001;
  double steering_sigma_rad = 0.01;
  double reference_sigma_m = 0.1;
  double reference_sigma_rad = 0.02;
};

/// How a recording fits a reference.
struct DriveFit {
  /// Whitened innovations: independent, of variance 1, if parameters and noise are right.
  Eigen::VectorXd residuals;
  double cost = 0.0;   ///< Minus twice the logarithm of the likelihood, less a constant.
  int references = 0;  ///< Used.
  int outliers = 0;    ///< Of these, so far off that they count less.
};

/// A Kalman filter over the body's pose that integrates the recorded motion and is corrected by the
/// reference. Its innovations are what a calibration makes small, and their likelihood is what the
/// noise is measured by: errors that add up along the way and those of single reference poses are
/// told apart.
///
/// Borrows the recording, which must outlive it. Thread-bound.
class DriveFilter {
 public:
  /// References outside of the recording, or nearer to its ends than `margin_s`, by which the time
  /// offset may be looked for, are left out.
  DriveFilter(const OdometryRecording& recording,
              std::vector<ReferencePose> references,
              TurnSource source,
              double margin_s);

  [[nodiscard]] DriveFit Run(const DriveParameters& parameters, const DriveNoise& noise) const;

  /// Where the body was at the references' times, with headings, by all of them and the recording
  /// together (Rauch, Tung and Striebel): what is off in single references is taken out of it.
  [[nodiscard]] std::vector<ReferencePose> Smooth(const DriveParameters& parameters,
                                                  const DriveNoise& noise) const;

  [[nodiscard]] const std::vector<ReferencePose>& references() const { return references_; }

 private:
  /// The recording at any time, interpolated.
  struct Instant {
    double time_s = 0.0;
    double left_m = 0.0;
    double right_m = 0.0;
    double yaw_rad = 0.0;
    double steering_rad = 0.0;
    bool is_slipping = false;
  };
  struct State {
    Pose2 X_WB;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  };
  /// At one reference.
  struct Step {
    State predicted;
    State corrected;
  };

  /// @param steps  nullptr: they are not asked for.
  DriveFit Pass(const DriveParameters& parameters,
                const DriveNoise& noise,
                std::vector<Step>* steps) const;
  [[nodiscard]] Instant At(std::size_t index, double time_s) const;
  [[nodiscard]] State Begin(const DriveParameters& parameters, const DriveNoise& noise) const;
  void Predict(const Instant& from,
               const Instant& to,
               const DriveParameters& parameters,
               const DriveNoise& noise,
               State& state) const;
  /// How the body turned over an interval, and the variance of that.
  [[nodiscard]] Eigen::Vector2d Turn(const Instant& from,
                                     const Instant& to,
                                     const DriveParameters& parameters,
                                     const DriveNoise& noise) const;
  /// Takes a reference into the state. @return its whitened innovation.
  static Eigen::VectorXd Correct(const ReferencePose& reference,
                                 const DriveParameters& parameters,
                                 const DriveNoise& noise,
                                 State& state,
                                 DriveFit& fit);

  const OdometryRecording& recording_;
  std::vector<ReferencePose> references_;
  TurnSource source_;
};

}  // namespace relocd
