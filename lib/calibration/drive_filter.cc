#include "calibration/drive_filter.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include <Eigen/Cholesky>

#include "geometry/angle.h"
#include "odometry/differential_drive.h"

namespace relocd {
namespace {

/// Innovations of a larger Mahalanobis distance count less: 1 of 1000 of three dimensions.
constexpr double kMaxDistance = 4.0;
/// Of the travel of slipping wheels.
constexpr double kSlip = 0.3;

double Square(double value) {
  return value * value;
}

/// The innovation of one reference, in R, and its Jacobian of the state's error.
struct Innovation {
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd variance;  ///< Of the reference.
};

Innovation Innovate(const Pose2& X_WB,
                    const Pose2& X_BR,
                    const ReferencePose& reference,
                    const DriveNoise& noise) {
  const Eigen::Index size = reference.has_heading ? 3 : 2;
  const Pose2 X_RZ = (X_WB * X_BR).Inverse() * reference.X_WR;
  const Eigen::Vector3d residual(X_RZ.x(), X_RZ.y(), X_RZ.yaw());
  Eigen::Vector3d variance(Square(noise.reference_sigma_m),
                           Square(noise.reference_sigma_m),
                           Square(noise.reference_sigma_rad));
  return {.residual = residual.head(size),
          .jacobian = X_BR.Inverse().Adjoint().topRows(size),
          .variance = variance.head(size)};
}

}  // namespace

DriveFilter::DriveFilter(const OdometryRecording& recording,
                         std::vector<ReferencePose> references,
                         TurnSource source,
                         double margin_s)
    : recording_(recording), source_(source) {
  const double begin_s = recording.samples.front().time_s + margin_s;
  const double end_s = recording.samples.back().time_s - margin_s;
  std::copy_if(references.begin(),
               references.end(),
               std::back_inserter(references_),
               [&](const ReferencePose& reference) {
                 return reference.time_s >= begin_s && reference.time_s <= end_s;
               });
}

DriveFilter::Instant DriveFilter::At(std::size_t index, double time_s) const {
  const OdometryRecording::Sample& from = recording_.samples[index];
  const OdometryRecording::Sample& to = recording_.samples[index + 1];
  const double part = (time_s - from.time_s) / (to.time_s - from.time_s);
  const auto between = [part](double a, double b) { return a + part * (b - a); };
  return {.time_s = time_s,
          .left_m = between(from.travel_m[0], to.travel_m[0]),
          .right_m = between(from.travel_m[1], to.travel_m[1]),
          .yaw_rad = between(from.yaw_rad, to.yaw_rad),
          .steering_rad = between(from.steering_rad, to.steering_rad),
          .is_slipping = to.is_slipping};
}

DriveFilter::State DriveFilter::Begin(const DriveParameters& parameters,
                                      const DriveNoise& noise) const {
  const ReferencePose& first = references_.front();
  const Pose2 X_RB =
      Pose2(parameters.mount_x_m, parameters.mount_y_m, parameters.mount_yaw_rad).Inverse();
  State state{.X_WB = first.X_WR * X_RB};
  double sigma_rad = noise.reference_sigma_rad;
  if (!first.has_heading) {
    // The course to the first reference that is far enough away.
    constexpr double kBaseM = 2.0;
    constexpr double kCourseSigmaRad = 0.5;
    double yaw_rad = 0.0;
    for (const ReferencePose& reference : references_) {
      const Eigen::Vector2d way_m = reference.X_WR.translation() - first.X_WR.translation();
      if (way_m.norm() < kBaseM) continue;
      yaw_rad = std::atan2(way_m.y(), way_m.x());
      break;
    }
    state.X_WB = Pose2(first.X_WR.x(), first.X_WR.y(), yaw_rad) *
                 Pose2(-parameters.mount_x_m, -parameters.mount_y_m, 0.0);
    sigma_rad = kCourseSigmaRad;
  }
  state.covariance.diagonal() << Square(noise.reference_sigma_m), Square(noise.reference_sigma_m),
      Square(sigma_rad);
  return state;
}

Eigen::Vector2d DriveFilter::Turn(const Instant& from,
                                  const Instant& to,
                                  const DriveParameters& parameters,
                                  const DriveNoise& noise) const {
  const double left_m = parameters.left_scale * (to.left_m - from.left_m);
  const double right_m = parameters.right_scale * (to.right_m - from.right_m);
  const double forward_m = 0.5 * (left_m + right_m);
  double turn_rad = 0.0;
  double variance = 0.0;
  switch (source_) {
    case TurnSource::kWheels:
      turn_rad = (right_m - left_m) / parameters.track_m;
      variance = Square(noise.wheel_sigma_m_per_sqrt_m / parameters.track_m) *
                 (std::abs(left_m) + std::abs(right_m));
      if (to.is_slipping) variance += 2.0 * Square(kSlip * forward_m / parameters.track_m);
      break;
    case TurnSource::kYawRate: {
      const double duration_s = to.time_s - from.time_s;
      turn_rad = parameters.yaw_rate_scale *
                 (to.yaw_rad - from.yaw_rad - parameters.yaw_rate_bias_radps * duration_s);
      variance = Square(noise.yaw_rate_noise_rad_per_sqrt_s) * duration_s;
      break;
    }
    case TurnSource::kSteering: {
      const double sensor_rad = 0.5 * (from.steering_rad + to.steering_rad);
      const double angle_rad = std::clamp(
          (sensor_rad - parameters.steering_offset_rad) / parameters.steering_ratio, -1.4, 1.4);
      const double tangent = std::tan(angle_rad);
      turn_rad = forward_m * tangent / parameters.wheelbase_m;
      variance =
          Square((1.0 + Square(tangent)) / parameters.wheelbase_m * noise.steering_sigma_rad) *
          std::abs(forward_m);
      break;
    }
  }
  variance += Square(noise.turn_sigma_rad_per_sqrt_rad) * std::abs(turn_rad);
  return {turn_rad, variance};
}

void DriveFilter::Predict(const Instant& from,
                          const Instant& to,
                          const DriveParameters& parameters,
                          const DriveNoise& noise,
                          State& state) const {
  const double left_m = parameters.left_scale * (to.left_m - from.left_m);
  const double right_m = parameters.right_scale * (to.right_m - from.right_m);
  const double travel_m = std::abs(left_m) + std::abs(right_m);
  const Eigen::Vector2d turn = Turn(from, to, parameters, noise);
  const Eigen::Vector3d tangent(0.5 * (left_m + right_m), 0.0, turn[0]);
  // What stands still is not known better than this, as in odometry's defaults.
  constexpr double kIdleVariance = 1e-8;
  const double idle = kIdleVariance * (to.time_s - from.time_s);
  Eigen::Vector3d variance(0.25 * Square(noise.wheel_sigma_m_per_sqrt_m) * travel_m + idle,
                           0.5 * Square(noise.lateral_sigma_m_per_sqrt_m) * travel_m + idle,
                           turn[1] + idle);
  if (to.is_slipping) variance[0] += 0.5 * Square(kSlip * tangent.x());
  const Pose2 X_BiBj = Pose2::Exp(tangent);
  const Eigen::Matrix3d transport = X_BiBj.Inverse().Adjoint();
  state.X_WB = state.X_WB * X_BiBj;
  state.covariance = transport * state.covariance * transport.transpose();
  state.covariance.diagonal() += variance;
}

Eigen::VectorXd DriveFilter::Correct(const ReferencePose& reference,
                                     const DriveParameters& parameters,
                                     const DriveNoise& noise,
                                     State& state,
                                     DriveFit& fit) {
  const Pose2 X_BR(parameters.mount_x_m, parameters.mount_y_m, parameters.mount_yaw_rad);
  const Innovation innovation = Innovate(state.X_WB, X_BR, reference, noise);
  const Eigen::MatrixXd& jacobian = innovation.jacobian;
  const Eigen::MatrixXd predicted = jacobian * state.covariance * jacobian.transpose();
  Eigen::VectorXd variance = innovation.variance;
  Eigen::LLT<Eigen::MatrixXd> llt(predicted + Eigen::MatrixXd(variance.asDiagonal()));
  const double distance = llt.matrixL().solve(innovation.residual).norm();
  if (distance > kMaxDistance) {
    ++fit.outliers;
    variance *= Square(distance / kMaxDistance);
    llt.compute(predicted + Eigen::MatrixXd(variance.asDiagonal()));
  }
  Eigen::VectorXd whitened = llt.matrixL().solve(innovation.residual);
  fit.cost +=
      whitened.squaredNorm() + 2.0 * Eigen::MatrixXd(llt.matrixL()).diagonal().array().log().sum();
  const Eigen::MatrixXd gain = llt.solve(jacobian * state.covariance).transpose();
  state.X_WB = state.X_WB * Pose2::Exp(gain * innovation.residual);
  const Eigen::Matrix3d rest = Eigen::Matrix3d::Identity() - gain * jacobian;
  // Joseph's form, which stays positive definite.
  state.covariance =
      rest * state.covariance * rest.transpose() + gain * variance.asDiagonal() * gain.transpose();
  return whitened;
}

DriveFit DriveFilter::Run(const DriveParameters& parameters, const DriveNoise& noise) const {
  return Pass(parameters, noise, nullptr);
}

DriveFit DriveFilter::Pass(const DriveParameters& parameters,
                           const DriveNoise& noise,
                           std::vector<Step>* steps) const {
  DriveFit fit;
  fit.residuals.resize(static_cast<Eigen::Index>(3 * references_.size()));
  if (references_.empty()) return fit;
  State state = Begin(parameters, noise);
  if (steps != nullptr) steps->push_back({.predicted = state, .corrected = state});
  const auto& samples = recording_.samples;
  const auto clamp_s = [&](double time_s) {
    return std::clamp(time_s, samples.front().time_s, samples.back().time_s);
  };
  std::size_t index = 0;
  const auto seek = [&](double time_s) {
    while (index + 2 < samples.size() && samples[index + 1].time_s <= time_s)
      ++index;
  };
  double time_s = clamp_s(references_.front().time_s + parameters.time_offset_s);
  seek(time_s);
  Instant now = At(index, time_s);
  Eigen::Index row = 0;
  for (std::size_t k = 1; k < references_.size(); ++k) {
    const double end_s = clamp_s(references_[k].time_s + parameters.time_offset_s);
    while (now.time_s < end_s) {
      seek(now.time_s);
      const Instant next = At(index, std::min(end_s, samples[index + 1].time_s));
      Predict(now, next, parameters, noise, state);
      if (next.time_s <= now.time_s) break;
      now = next;
    }
    const State predicted = state;
    const Eigen::VectorXd whitened = Correct(references_[k], parameters, noise, state, fit);
    fit.residuals.segment(row, whitened.size()) = whitened;
    row += whitened.size();
    if (steps != nullptr) steps->push_back({.predicted = predicted, .corrected = state});
  }
  fit.references = static_cast<int>(references_.size());
  fit.residuals.conservativeResize(row);
  return fit;
}

std::vector<ReferencePose> DriveFilter::Smooth(const DriveParameters& parameters,
                                               const DriveNoise& noise) const {
  std::vector<Step> steps;
  Pass(parameters, noise, &steps);
  std::vector<ReferencePose> smoothed(steps.size());
  for (std::size_t k = steps.size(); k-- > 0;) {
    Pose2 X_WB = steps[k].corrected.X_WB;
    if (k + 1 < steps.size()) {
      const State& next = steps[k + 1].predicted;
      // What was predicted turns and moves an error of the state before it by this.
      const Eigen::Matrix3d transport = (next.X_WB.Inverse() * X_WB).Adjoint();
      const Eigen::Matrix3d gain =
          next.covariance.llt().solve(transport * steps[k].corrected.covariance).transpose();
      X_WB = X_WB * Pose2::Exp(gain * (next.X_WB.Inverse() * smoothed[k + 1].X_WR).Log());
    }
    smoothed[k] = {.time_s = references_[k].time_s, .X_WR = X_WB, .has_heading = true};
  }
  return smoothed;
}

}  // namespace relocd
