#pragma once

#include <chrono>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "geometry/pose2.h"
#include "smoothing/offline_smoother.h"

namespace relocd {

struct DriveOptions {
  double duration_s = 120.0;
  double odometry_rate_hz = 20.0;
  double fix_rate_hz = 1.0;
  double speed_mps = 1.5;
  double fix_sigma_m = 0.3;
  double fix_heading_sigma_rad = 0.03;
  double outlier_share = 0.0;
  bool has_heading = true;
  double bias_sigmas = 0.0;  ///< Of a part of the fixes' errors that lasts, in their sigmas.
  double bias_time_s = 10.0;
  double camera_yaw_rad = 0.0;   ///< By which the fixes are turned to the left.
  double camera_time_s = 0.0;    ///< By which their times are late.
  double turn_rad_per_m = 0.15;  ///< At most, to both sides.
  OdometryNoiseConfig noise = {};
  Pose2 X_WB0{10.0, -20.0, 0.5};
};

/// A drive in curves, whose odometry and fixes err as their covariances say.
struct SimulatedDrive {
  MotionLog log;
  std::vector<Pose2> truth_at_fixes;
  Pose2 X_WB_end;
};

/// The same drive for the same seed.
class DriveSimulator {
 public:
  DriveSimulator(const DriveOptions& options, unsigned seed) : options_(options), engine_(seed) {}

  SimulatedDrive Run() {
    using std::chrono::nanoseconds;
    const auto steps = static_cast<int>(options_.duration_s * options_.odometry_rate_hz);
    const auto steps_per_fix =
        static_cast<int>(std::lround(options_.odometry_rate_hz / options_.fix_rate_hz));
    const Duration period = FromSeconds(1.0 / options_.odometry_rate_hz);
    SimulatedDrive drive;
    Pose2 X_WB = options_.X_WB0;
    MonotonicTime time(std::chrono::seconds(1000));
    for (int i = 0; i < steps; ++i, time += period) {
      const double t = ToSeconds(period) * i;
      const double travel = i == 0 ? 0.0 : options_.speed_mps * ToSeconds(period);
      const double turn = options_.turn_rad_per_m * std::sin(0.07 * t) * travel;
      const Pose2 motion = Pose2::Exp({travel, 0.0, turn});
      X_WB = X_WB * motion;
      OdometryStep step = MakeOdometryStep(time, period, motion, options_.noise);
      step.X_BprevB = motion * Pose2::Exp(Draw(step.covariance));
      drive.log.odometry.push_back(step);
      if (i % steps_per_fix != 0) continue;
      drive.log.fixes.push_back(MakeFix(time, X_WB));
      drive.truth_at_fixes.push_back(X_WB);
    }
    drive.X_WB_end = X_WB;
    return drive;
  }

  Eigen::Vector3d Draw(const Eigen::Matrix3d& covariance) {
    const Eigen::Vector3d standard(normal_(engine_), normal_(engine_), normal_(engine_));
    return covariance.llt().matrixL() * standard;
  }

  Fix MakeFix(MonotonicTime time, const Pose2& X_WB) {
    Fix fix;
    fix.time = time + FromSeconds(options_.camera_time_s);
    fix.has_heading = options_.has_heading;
    const Eigen::Vector3d sigmas(
        options_.fix_sigma_m, options_.fix_sigma_m, options_.fix_heading_sigma_rad);
    fix.covariance = sigmas.cwiseAbs2().asDiagonal();
    const Pose2 X_WM =
        X_WB * Pose2(0.0, 0.0, options_.camera_yaw_rad) * Pose2::Exp(Draw(fix.covariance));
    const Eigen::Vector3d bias = NextBias().cwiseProduct(sigmas);
    fix.X_WB = Pose2(X_WM.x() + bias.x(), X_WM.y() + bias.y(), X_WM.yaw() + bias.z());
    if (uniform_(engine_) < options_.outlier_share) {
      constexpr double kReach = 100.0;
      fix.X_WB = Pose2(X_WB.x() + kReach * (2.0 * uniform_(engine_) - 1.0),
                       X_WB.y() + kReach * (2.0 * uniform_(engine_) - 1.0),
                       10.0 * uniform_(engine_));
    }
    return fix;
  }

 private:
  /// A Gauss-Markov process, from one fix to the next.
  Eigen::Vector3d NextBias() {
    if (options_.bias_sigmas <= 0.0) return Eigen::Vector3d::Zero();
    const double kept = std::exp(-1.0 / (options_.fix_rate_hz * options_.bias_time_s));
    const double variance = options_.bias_sigmas * options_.bias_sigmas;
    bias_ = kept * bias_ + Draw(variance * (1.0 - kept * kept) * Eigen::Matrix3d::Identity());
    return bias_;
  }

  DriveOptions options_;
  std::mt19937 engine_;
  Eigen::Vector3d bias_ = Eigen::Vector3d::Zero();
  std::normal_distribution<double> normal_{0.0, 1.0};
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
};

/// The simulation's odometry errs independently from step to step, as its covariances say and not
/// all the time alike, and so do its fixes without a bias.
inline SmootherConfig ConfigForIndependentErrors() {
  SmootherConfig config;
  config.odometry_covariance_factor = 1.0;
  config.odometry_drift_sigma_rad_per_m = 0.0;
  config.odometry_scale_sigma = 0.0;
  config.fix_bias_sigmas = 0.0;
  return config;
}

}  // namespace relocd
