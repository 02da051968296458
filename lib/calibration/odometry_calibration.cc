#include "calibration/odometry_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "calibration/reference_selection.h"
#include "geometry/angle.h"

namespace relocd {
namespace {

/// A parameter, and how well it is known beforehand.
struct Prior {
  const char* name;
  double DriveParameters::*value;
  double sigma;
};

// Tyres of one size differ by 1 %, and from their nominal radius by a few. A drawing tells the
// track to some percent, but tyres do not touch the ground in one point.
constexpr std::array<Prior, 7> kWheelPriors = {{
    {"left_scale", &DriveParameters::left_scale, 0.05},
    {"right_scale", &DriveParameters::right_scale, 0.05},
    {"track", &DriveParameters::track_m, 0.15},
    {"time_offset", &DriveParameters::time_offset_s, 0.2},
    {"mount_x", &DriveParameters::mount_x_m, 3.0},
    {"mount_y", &DriveParameters::mount_y_m, 1.0},
    {"mount_yaw", &DriveParameters::mount_yaw_rad, 0.2},
}};
constexpr std::array<Prior, 2> kYawRatePriors = {{
    {"yaw_rate_scale", &DriveParameters::yaw_rate_scale, 0.1},
    {"yaw_rate_bias", &DriveParameters::yaw_rate_bias_radps, 0.1},
}};
constexpr std::array<Prior, 2> kSteeringPriors = {{
    {"steering_ratio", &DriveParameters::steering_ratio, 5.0},
    {"steering_offset", &DriveParameters::steering_offset_rad, 0.5},
}};
/// How far the time offset may reach beyond the recording's ends.
constexpr double kMarginS = 0.5;
/// A parameter whose deviation the drive left above this part of what it was is not known.
constexpr double kKnownPart = 0.5;
/// Below this turning along the way says nothing of its noise.
constexpr double kLeastTurnRad = 6.0;

/// One level of noise that is looked for, within limits that keep everything regular.
struct NoiseLevel {
  double DriveNoise::*value;
  double low;
  double high;
};

constexpr NoiseLevel kWheelSigma{&DriveNoise::wheel_sigma_m_per_sqrt_m, 1e-4, 1.0};
constexpr NoiseLevel kLateralSigma{&DriveNoise::lateral_sigma_m_per_sqrt_m, 1e-4, 1.0};
constexpr NoiseLevel kTurnSigma{&DriveNoise::turn_sigma_rad_per_sqrt_rad, 1e-4, 1.0};
constexpr NoiseLevel kYawRateNoise{&DriveNoise::yaw_rate_noise_rad_per_sqrt_s, 1e-6, 1.0};
constexpr NoiseLevel kSteeringSigma{&DriveNoise::steering_sigma_rad, 1e-5, 1.0};
constexpr NoiseLevel kReferenceSigma{&DriveNoise::reference_sigma_m, 1e-4, 100.0};
constexpr NoiseLevel kReferenceHeadingSigma{&DriveNoise::reference_sigma_rad, 1e-5, 3.0};

/// A noise that came out at its lower limit is one that the reference's hides.
bool IsMeasured(const DriveNoise& noise, const NoiseLevel& level) {
  return noise.*level.value > 3.0 * level.low;
}

/// What is looked for in one go.
struct Search {
  std::vector<Prior> priors{};
  std::vector<NoiseLevel> levels{};
};

/// Gauss and Newton over the parameters, and a pattern search over the noise, in turn.
class Fitter {
 public:
  Fitter(const DriveFilter& filter, DriveParameters initial, DriveNoise noise)
      : filter_(filter), initial_(initial), parameters_(initial), noise_(noise) {}

  void Fit(const Search& search) {
    constexpr int kRounds = 6;
    constexpr double kGain = 0.05;  // far below what tells one set of parameters from another
    double cost = std::numeric_limits<double>::infinity();
    for (int round = 0; round < kRounds; ++round) {
      FitParameters(search.priors);
      FitNoise(search.levels);
      const double next = filter_.Run(parameters_, noise_).cost;
      if (next > cost - kGain) break;
      cost = next;
    }
    FitParameters(search.priors);
  }

  [[nodiscard]] const DriveParameters& parameters() const { return parameters_; }
  [[nodiscard]] const DriveNoise& noise() const { return noise_; }
  /// Of the priors given last.
  [[nodiscard]] const Eigen::VectorXd& sigmas() const { return sigmas_; }
  [[nodiscard]] DriveFit fit() const { return filter_.Run(parameters_, noise_); }

 private:
  [[nodiscard]] double PriorCost(const std::vector<Prior>& priors,
                                 const DriveParameters& parameters) const {
    double cost = 0.0;
    for (const Prior& prior : priors)
      cost += std::pow((parameters.*prior.value - initial_.*prior.value) / prior.sigma, 2);
    return cost;
  }

  void FitParameters(const std::vector<Prior>& priors) {
    const auto size = static_cast<Eigen::Index>(priors.size());
    sigmas_ = Eigen::VectorXd::Zero(size);
    if (size == 0) return;
    constexpr int kIterations = 12;
    double damping = 0.0;
    DriveFit fit = filter_.Run(parameters_, noise_);
    double cost = fit.cost + PriorCost(priors, parameters_);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const Eigen::MatrixXd jacobian = Jacobian(priors, fit.residuals.size());
      Eigen::MatrixXd information = jacobian.transpose() * jacobian;
      Eigen::VectorXd gradient = jacobian.transpose() * fit.residuals;
      for (Eigen::Index i = 0; i < size; ++i) {
        const Prior& prior = priors[static_cast<std::size_t>(i)];
        information(i, i) += 1.0 / (prior.sigma * prior.sigma);
        gradient[i] +=
            (parameters_.*prior.value - initial_.*prior.value) / (prior.sigma * prior.sigma);
      }
      const Eigen::MatrixXd covariance =
          information.ldlt().solve(Eigen::MatrixXd::Identity(size, size));
      sigmas_ = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
      information.diagonal() *= 1.0 + damping;
      const Eigen::VectorXd step = -information.ldlt().solve(gradient);
      DriveParameters next = parameters_;
      for (Eigen::Index i = 0; i < size; ++i)
        next.*priors[static_cast<std::size_t>(i)].value += step[i];
      const DriveFit next_fit = filter_.Run(next, noise_);
      const double next_cost = next_fit.cost + PriorCost(priors, next);
      if (!(next_cost < cost)) {
        if (damping > 1e3) return;
        damping = std::max(10.0 * damping, 1e-2);
        continue;
      }
      const double gained = cost - next_cost;
      damping *= 0.1;
      parameters_ = next;
      fit = next_fit;
      cost = next_cost;
      if (gained < 1e-4) return;
    }
  }

  [[nodiscard]] Eigen::MatrixXd Jacobian(const std::vector<Prior>& priors,
                                         Eigen::Index rows) const {
    Eigen::MatrixXd jacobian(rows, static_cast<Eigen::Index>(priors.size()));
    constexpr double kStep = 1e-3;  // of what is expected: far above rounding, far below bends
    for (std::size_t i = 0; i < priors.size(); ++i) {
      const double step = kStep * priors[i].sigma;
      DriveParameters plus = parameters_;
      DriveParameters minus = parameters_;
      plus.*priors[i].value += step;
      minus.*priors[i].value -= step;
      jacobian.col(static_cast<Eigen::Index>(i)) =
          (filter_.Run(plus, noise_).residuals - filter_.Run(minus, noise_).residuals) /
          (2.0 * step);
    }
    return jacobian;
  }

  void FitNoise(const std::vector<NoiseLevel>& levels) {
    double cost = filter_.Run(parameters_, noise_).cost;
    for (const double factor : {3.0, 1.6, 1.25, 1.1, 1.04}) {
      constexpr int kSweeps = 8;
      bool better = true;
      for (int sweep = 0; better && sweep < kSweeps; ++sweep) {
        better = false;
        for (const NoiseLevel& level : levels)
          better = TryLevel(level, factor, cost) || better;
      }
    }
  }

  bool TryLevel(const NoiseLevel& level, double factor, double& cost) {
    const double now = noise_.*level.value;
    for (const double candidate : {now * factor, now / factor}) {
      if (candidate < level.low || candidate > level.high) continue;
      DriveNoise next = noise_;
      next.*level.value = candidate;
      const double next_cost = filter_.Run(parameters_, next).cost;
      if (!(next_cost < cost)) continue;
      cost = next_cost;
      noise_ = next;
      return true;
    }
    return false;
  }

  const DriveFilter& filter_;
  DriveParameters initial_;
  DriveParameters parameters_;
  DriveNoise noise_;
  Eigen::VectorXd sigmas_;
};

/// Looks for parameters, gives up those that the drive does not tell, and looks for the others
/// again.
DriveFit Calibrate(const DriveFilter& filter,
                   const Search& search,
                   const std::set<std::string>& fixed,
                   OdometryCalibration& calibration) {
  Search open = search;
  std::erase_if(open.priors, [&](const Prior& prior) { return fixed.contains(prior.name); });
  const DriveParameters initial = calibration.drive;
  std::vector<CalibratedParameter> unknown;
  while (true) {
    Fitter fitter(filter, initial, calibration.noise);
    fitter.Fit(open);
    // The worst of those that are not known; without it others may be.
    std::size_t worst = open.priors.size();
    double worst_part = kKnownPart;
    for (std::size_t i = 0; i < open.priors.size(); ++i) {
      const double part = fitter.sigmas()[static_cast<Eigen::Index>(i)] / open.priors[i].sigma;
      if (part < worst_part) continue;
      worst = i;
      worst_part = part;
    }
    if (worst < open.priors.size()) {
      const Prior& prior = open.priors[worst];
      unknown.push_back({.name = prior.name,
                         .before = initial.*prior.value,
                         .expected_sigma = prior.sigma,
                         .after = initial.*prior.value,
                         .sigma = worst_part * prior.sigma});
      open.priors.erase(open.priors.begin() + static_cast<std::ptrdiff_t>(worst));
      continue;
    }
    for (std::size_t i = 0; i < open.priors.size(); ++i) {
      const Prior& prior = open.priors[i];
      calibration.parameters.push_back({.name = prior.name,
                                        .before = initial.*prior.value,
                                        .expected_sigma = prior.sigma,
                                        .after = fitter.parameters().*prior.value,
                                        .sigma = fitter.sigmas()[static_cast<Eigen::Index>(i)],
                                        .is_known = true});
    }
    calibration.parameters.insert(calibration.parameters.end(), unknown.begin(), unknown.end());
    calibration.drive = fitter.parameters();
    calibration.noise = fitter.noise();
    return fitter.fit();
  }
}

/// How far the reference moves and turns.
struct Extent {
  double length_m = 0.0;
  double turn_rad = 0.0;
  bool has_heading = true;
};

Extent Measure(const std::vector<ReferencePose>& references) {
  Extent extent;
  for (std::size_t i = 0; i < references.size(); ++i) {
    extent.has_heading = extent.has_heading && references[i].has_heading;
    if (i == 0) continue;
    const Pose2 X_RiRj = references[i - 1].X_WR.Inverse() * references[i].X_WR;
    extent.length_m += X_RiRj.translation().norm();
    extent.turn_rad += std::abs(X_RiRj.yaw());
  }
  return extent;
}

DriveParameters InitialParameters(const OdometryConfig& config, const DriveParameters& given) {
  DriveParameters initial = given;
  initial.left_scale = 1.0;
  initial.right_scale = 1.0;
  initial.track_m = config.drive.track_m;
  initial.wheelbase_m = config.drive.wheelbase_m;
  initial.steering_ratio = config.steering.ratio;
  initial.steering_offset_rad = config.steering.offset_rad;
  initial.yaw_rate_scale = config.yaw_rate.scale;
  initial.yaw_rate_bias_radps = config.yaw_rate.bias_radps;
  return initial;
}

void CalibrateSensors(const OdometryRecording& recording,
                      const std::vector<ReferencePose>& references,
                      const std::set<std::string>& fixed,
                      OdometryCalibration& calibration) {
  if (recording.has_yaw_rate) {
    const DriveFilter filter(recording, references, TurnSource::kYawRate, kMarginS);
    Calibrate(filter,
              {.priors = {kYawRatePriors.begin(), kYawRatePriors.end()}, .levels = {kYawRateNoise}},
              fixed,
              calibration);
    calibration.has_yaw_rate_noise = IsMeasured(calibration.noise, kYawRateNoise);
  }
  if (recording.has_steering) {
    const DriveFilter filter(recording, references, TurnSource::kSteering, kMarginS);
    Calibrate(
        filter,
        {.priors = {kSteeringPriors.begin(), kSteeringPriors.end()}, .levels = {kSteeringSigma}},
        fixed,
        calibration);
    calibration.has_steering_noise = IsMeasured(calibration.noise, kSteeringSigma);
  }
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// How far the front wheels, left and right, should have rolled by the calibrated rear axle in
/// about a second, and what they measured.
struct FrontBlock {
  Eigen::Array2d expected_m = Eigen::Array2d::Zero();
  Eigen::Array2d measured_m = Eigen::Array2d::Zero();
  bool is_slipping = false;

  [[nodiscard]] Eigen::Array2d Ratio() const { return expected_m / measured_m; }
};

/// Of the recording's part from `begin_s` to `end_s`, as far as the wheels rolled without slip.
std::vector<FrontBlock> FrontBlocks(const OdometryRecording& recording,
                                    const DriveParameters& drive,
                                    double begin_s,
                                    double end_s) {
  constexpr double kBlockS = 1.0;
  constexpr double kLeastM = 0.5;
  const auto& samples = recording.samples;
  std::vector<FrontBlock> blocks;
  FrontBlock block;
  double block_s = begin_s;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const auto& from = samples[i - 1];
    const auto& to = samples[i];
    if (from.time_s < begin_s || to.time_s > end_s) continue;
    const double left_m = drive.left_scale * (to.travel_m[0] - from.travel_m[0]);
    const double right_m = drive.right_scale * (to.travel_m[1] - from.travel_m[1]);
    const double turn_rad = (right_m - left_m) / drive.track_m;
    for (Eigen::Index side = 0; side < 2; ++side) {
      const double y_m = (side == 0 ? 0.5 : -0.5) * drive.track_m;
      const double along_m = 0.5 * (left_m + right_m) - y_m * turn_rad;
      block.expected_m[side] +=
          std::copysign(std::hypot(along_m, drive.wheelbase_m * turn_rad), along_m);
      const auto wheel = static_cast<std::size_t>(2 + side);
      block.measured_m[side] += to.travel_m.at(wheel) - from.travel_m.at(wheel);
    }
    block.is_slipping = block.is_slipping || to.is_slipping;
    if (to.time_s < block_s + kBlockS) continue;
    if (!block.is_slipping && block.measured_m.abs().minCoeff() > kLeastM) blocks.push_back(block);
    block = {};
    block_s = to.time_s;
  }
  return blocks;
}

/// Leaves out blocks in which a front wheel rolled unlike in most others.
void DropOutliers(std::vector<FrontBlock>& blocks) {
  constexpr double kMaxDeviations = 4.0;
  constexpr double kSigmaOfMedian = 1.4826;  // of a normal distribution
  for (Eigen::Index side = 0; side < 2; ++side) {
    std::vector<double> ratios;
    ratios.reserve(blocks.size());
    for (const FrontBlock& block : blocks)
      ratios.push_back(block.Ratio()[side]);
    const double median = Median(ratios);
    for (double& ratio : ratios)
      ratio = std::abs(ratio - median);
    const double allowed = kMaxDeviations * kSigmaOfMedian * Median(ratios) + 1e-9;
    std::erase_if(blocks, [&](const FrontBlock& block) {
      return std::abs(block.Ratio()[side] - median) > allowed;
    });
  }
}

/// The front wheels' scales: the way they should have rolled over the way they measured. What the
/// drive's torque slips is the same on both sides, and back and forth in part; medians of single
/// seconds, each wheel's by itself, would have the heading pay for it.
void CalibrateFront(const OdometryRecording& recording,
                    double begin_s,
                    double end_s,
                    OdometryCalibration& calibration) {
  constexpr std::size_t kLeastBlocks = 5;
  std::vector<FrontBlock> blocks = FrontBlocks(recording, calibration.drive, begin_s, end_s);
  const bool is_known = blocks.size() >= kLeastBlocks;
  FrontBlock sum;
  Eigen::Array2d squared = Eigen::Array2d::Zero();
  if (is_known) {
    DropOutliers(blocks);
    for (const FrontBlock& block : blocks) {
      sum.expected_m += block.expected_m;
      sum.measured_m += block.measured_m;
    }
    for (const FrontBlock& block : blocks)
      squared += (block.Ratio() - sum.Ratio()).square();
  }
  const auto count = static_cast<double>(blocks.size());
  for (Eigen::Index side = 0; side < 2; ++side) {
    CalibratedParameter parameter{.name = side == 0 ? "front_left_scale" : "front_right_scale",
                                  .before = 1.0,
                                  .expected_sigma = 0.05,
                                  .after = 1.0,
                                  .sigma = 0.05,
                                  .is_known = is_known};
    if (is_known) {
      parameter.after = sum.Ratio()[side];
      parameter.sigma = std::sqrt(squared[side] / (count - 1.0) / count);
    }
    calibration.parameters.push_back(parameter);
  }
}

}  // namespace

std::vector<std::string> CalibrationParameterNames() {
  std::vector<std::string> names;
  names.reserve(kWheelPriors.size() + kYawRatePriors.size() + kSteeringPriors.size());
  for (const Prior& prior : kWheelPriors)
    names.emplace_back(prior.name);
  for (const Prior& prior : kYawRatePriors)
    names.emplace_back(prior.name);
  for (const Prior& prior : kSteeringPriors)
    names.emplace_back(prior.name);
  return names;
}

Result<OdometryCalibration> CalibrateOdometry(const OdometryRecording& recording,
                                              const std::vector<ReferencePose>& references,
                                              const OdometryConfig& config,
                                              const OdometryCalibrationOptions& options) {
  const ReferenceSelection selection = SelectReferences(recording, references, options.spacing_s);
  const DriveFilter filter(recording, selection.poses, TurnSource::kWheels, kMarginS);
  const Extent extent = Measure(filter.references());
  constexpr std::size_t kLeastReferences = 10;
  constexpr double kLeastLengthM = 5.0;
  if (filter.references().size() < kLeastReferences || extent.length_m < kLeastLengthM) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format(
            "the reference has {} poses over {:.1f} m while the vehicle was recorded, and {} that "
            "odometry contradicts, must have at least {}, {} s apart, over {} m",
            filter.references().size(),
            extent.length_m,
            selection.disagreeing,
            kLeastReferences,
            options.spacing_s,
            kLeastLengthM)};
  }
  OdometryCalibration calibration;
  calibration.drive = InitialParameters(config, options.initial);
  calibration.noise.wheel_sigma_m_per_sqrt_m =
      std::max(config.drive.wheel_sigma_m_per_sqrt_m, 0.02);
  calibration.noise.turn_sigma_rad_per_sqrt_rad = config.drive.turn_sigma_rad_per_sqrt_rad;
  Search search{.priors = {kWheelPriors.begin(), kWheelPriors.end()},
                .levels = {kReferenceSigma, kWheelSigma, kLateralSigma}};
  std::set<std::string> fixed = options.fixed;
  if (extent.has_heading) {
    search.levels.push_back(kReferenceHeadingSigma);
  } else {
    fixed.insert("mount_yaw");  // nothing tells it
  }
  calibration.has_turn_noise = extent.turn_rad > kLeastTurnRad;
  if (calibration.has_turn_noise) search.levels.push_back(kTurnSigma);
  const DriveFit fit = Calibrate(filter, search, fixed, calibration);
  calibration.has_wheel_noise = IsMeasured(calibration.noise, kWheelSigma);
  calibration.has_lateral_noise = IsMeasured(calibration.noise, kLateralSigma);
  calibration.has_turn_noise =
      calibration.has_turn_noise && IsMeasured(calibration.noise, kTurnSigma);
  calibration.references = fit.references + selection.disagreeing;
  calibration.outliers = fit.outliers + selection.disagreeing;
  calibration.residual_rms =
      std::sqrt(fit.residuals.squaredNorm() / static_cast<double>(fit.residuals.size()));
  CalibrateSensors(recording, filter.references(), fixed, calibration);
  if (recording.has_front) {
    const double offset_s = calibration.drive.time_offset_s;
    CalibrateFront(recording,
                   filter.references().front().time_s + offset_s,
                   filter.references().back().time_s + offset_s,
                   calibration);
  }
  return calibration;
}

std::vector<ReferencePose> SmoothReference(const OdometryRecording& recording,
                                           const std::vector<ReferencePose>& references,
                                           const OdometryCalibration& calibration,
                                           double spacing_s) {
  return DriveFilter(recording,
                     SelectReferences(recording, references, spacing_s).poses,
                     TurnSource::kWheels,
                     std::abs(calibration.drive.time_offset_s))
      .Smooth(calibration.drive, calibration.noise);
}

OdometryConfig ApplyCalibration(const OdometryConfig& config,
                                const OdometryCalibration& calibration) {
  OdometryConfig applied = config;
  const DriveParameters& drive = calibration.drive;
  if (config.wheels.kind == "ticks") {
    applied.drive.left_radius_m *= drive.left_scale;
    applied.drive.right_radius_m *= drive.right_scale;
  } else {
    applied.drive.left_scale *= drive.left_scale;
    applied.drive.right_scale *= drive.right_scale;
  }
  applied.drive.track_m = drive.track_m;
  if (calibration.has_wheel_noise)
    applied.drive.wheel_sigma_m_per_sqrt_m = calibration.noise.wheel_sigma_m_per_sqrt_m;
  if (calibration.has_lateral_noise)
    applied.drive.lateral_sigma_m_per_sqrt_m = calibration.noise.lateral_sigma_m_per_sqrt_m;
  if (calibration.has_turn_noise)
    applied.drive.turn_sigma_rad_per_sqrt_rad = calibration.noise.turn_sigma_rad_per_sqrt_rad;
  if (calibration.has_yaw_rate_noise)
    applied.yaw_rate.noise_rad_per_sqrt_s = calibration.noise.yaw_rate_noise_rad_per_sqrt_s;
  if (calibration.has_steering_noise)
    applied.steering.sigma_rad = calibration.noise.steering_sigma_rad;
  applied.steering.ratio = drive.steering_ratio;
  applied.steering.offset_rad = drive.steering_offset_rad;
  applied.yaw_rate.scale = drive.yaw_rate_scale;
  applied.yaw_rate.bias_radps = drive.yaw_rate_bias_radps;
  for (const CalibratedParameter& parameter : calibration.parameters) {
    if (!parameter.is_known) continue;
    if (parameter.name == "front_left_scale") applied.drive.front_left_scale *= parameter.after;
    if (parameter.name == "front_right_scale") applied.drive.front_right_scale *= parameter.after;
    if (parameter.name == "yaw_rate_bias")
      applied.yaw_rate.bias_sigma_radps = std::max(parameter.sigma, 1e-5);
  }
  return applied;
}

}  // namespace relocd
