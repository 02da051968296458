#include "odometry/wheel_odometry.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "odometry/wheel_encoder.h"

namespace relocd {
namespace {

/// Front and rear axle of a car that creeps round a corner differ by more than a part of it.
constexpr double kAxleDifference = 0.5;  // m/s
/// For how long a disagreement of wheels and yaw rate adds up, and how much of it is the fault of
/// measurements that are not of the same time.
constexpr double kAgreementS = 0.5;
constexpr double kAgreementRad = 0.01;
/// For so long a body may turn though its wheels seem to stand: they creep below what their sensors
/// see, or it is carried. A yaw rate that goes on is a bias that has changed.
constexpr double kUnseenTurnS = 30.0;
/// So many sets of measurements in a row that are older than the last one, but rise: the clock has
/// jumped back, or the last one was of a wrong time.
constexpr int kOldAreNew = 100;

double Square(double value) {
  return value * value;
}

Error Invalid(const char* name, double value, const std::string& allowed) {
  return {ErrorKind::kInvalidInput, fmt::format("{} is {}, must be {}", name, value, allowed)};
}

Error InSection(const char* section, const Error& error) {
  return {error.kind, fmt::format("{}.{}", section, error.message)};
}

}  // namespace

Result<void> OdometryConfig::Validate() const {
  if (model != "differential" && model != "ackermann" && model != "four_wheel") {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("model is '{}', must be one of differential, ackermann, four_wheel", model)};
  }
  if (model == "ackermann" && steering.signal.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 "steering.signal is '', must be MESSAGE.SIGNAL with model ackermann"};
  }
  if (model == "four_wheel" && wheels.front_left_signal.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 "wheels.front_left_signal is '', must be MESSAGE.SIGNAL with model four_wheel"};
  }
  if (auto ok = steering.Validate(); !ok) return InSection("steering", ok.error());
  if (auto ok = yaw_rate.Validate(); !ok) return InSection("yaw_rate", ok.error());
  if (auto ok = wheels.Validate(); !ok) return InSection("wheels", ok.error());
  if (auto ok = drive.Validate(); !ok) return InSection("drive", ok.error());
  struct Field {
    const char* name;
    double value;
  };
  // `!(value > 0)` is also true of NaN.
  for (const Field& field : {Field{"max_interval_s", max_interval_s},
                             Field{"stale_period_s", stale_period_s},
                             Field{"max_speed_mps", max_speed_mps},
                             Field{"max_yaw_rate_radps", max_yaw_rate_radps},
                             Field{"max_acceleration_mps2", max_acceleration_mps2},
                             Field{"max_axle_difference", max_axle_difference},
                             Field{"max_deviation_sigma", max_deviation_sigma},
                             Field{"slip_sigma", slip_sigma},
                             Field{"unknown_acceleration_mps2", unknown_acceleration_mps2}}) {
    if (!(field.value > 0.0) || !std::isfinite(field.value)) {
      return Invalid(field.name, field.value, "positive and finite");
    }
  }
  for (const Field& field : {Field{"extrapolate_s", extrapolate_s},
                             Field{"standstill_speed_mps", standstill_speed_mps},
                             Field{"standstill_after_s", standstill_after_s}}) {
    if (!(field.value >= 0.0) || !std::isfinite(field.value)) {
      return Invalid(field.name, field.value, "at least 0 and finite");
    }
  }
  if (!(stale_after_s >= max_interval_s) || !std::isfinite(stale_after_s)) {
    return Invalid(
        "stale_after_s", stale_after_s, fmt::format("at least max_interval_s, {}", max_interval_s));
  }
  return {};
}

Result<WheelOdometry> WheelOdometry::Create(const OdometryConfig& config,
                                            const DbcFile& dbc,
                                            const WheelSignals::Rules& rules) {
  if (auto ok = config.Validate(); !ok) return std::move(ok).error();
  auto signals = WheelSignals::Create(config.wheels, dbc, rules);
  if (!signals) return std::move(signals).error();
  WheelOdometry odometry(config, std::move(signals).value());
  if (auto ok = odometry.AddSensors(dbc, rules); !ok) return std::move(ok).error();
  if (odometry.IsAmbiguous(config.max_interval_s)) {
    return Invalid("max_speed_mps",
                   config.max_speed_mps,
                   "less, or the counters go round more than half their range in max_interval_s");
  }
  return odometry;
}

Result<void> WheelOdometry::AddSensors(const DbcFile& dbc, const WheelSignals::Rules& rules) {
  const auto add = [&](const std::string& name, std::optional<SignalReader>& to) -> Result<void> {
    if (name.empty()) return {};
    auto reader = SignalReader::Create(name, dbc, rules);
    if (!reader) return std::move(reader).error();
    to = std::move(reader).value();
    return {};
  };
  if (auto ok = add(config_.steering.signal, steering_signal_); !ok) return ok;
  if (auto ok = add(config_.steering.fraction_signal, steering_fraction_); !ok) return ok;
  if (auto ok = add(config_.yaw_rate.signal, yaw_rate_signal_); !ok) return ok;
  if (!yaw_rate_signal_) return {};
  const double resolution_radps =
      std::abs(yaw_rate_signal_->signal().factor * config_.yaw_rate.unit_radps);
  yaw_rate_ = YawRateSensor(config_.yaw_rate, resolution_radps, yaw_rate_signal_->max_age());
  return {};
}

std::vector<CanId> WheelOdometry::ids() const {
  std::vector<CanId> ids = signals_.ids();
  for (const auto* reader : {&steering_signal_, &steering_fraction_, &yaw_rate_signal_}) {
    if (!reader->has_value()) continue;
    const CanId id = (*reader)->id();
    if (std::find(ids.begin(), ids.end(), id) == ids.end()) ids.push_back(id);
  }
  return ids;
}

MessageGuard::Counters WheelOdometry::frame_counters() const {
  MessageGuard::Counters sum = signals_.counters();
  std::vector<CanId> counted = signals_.ids();
  for (const auto* reader : {&steering_signal_, &steering_fraction_, &yaw_rate_signal_}) {
    if (!reader->has_value()) continue;
    const CanId id = (*reader)->id();
    if (std::find(counted.begin(), counted.end(), id) != counted.end()) continue;
    counted.push_back(id);
    sum += (*reader)->counters();
  }
  return sum;
}

std::optional<double> WheelOdometry::yaw_rate_bias_radps() const {
  if (!yaw_rate_) return std::nullopt;
  return yaw_rate_->bias_radps();
}

void WheelOdometry::HandleSensors(const CanFrame& frame) {
  last_yaw_rate_.reset();
  if (steering_signal_) steering_signal_->Handle(frame);
  if (steering_fraction_) steering_fraction_->Handle(frame);
  if (!yaw_rate_signal_) return;
  if (const auto rate = yaw_rate_signal_->Handle(frame)) {
    last_yaw_rate_ = {frame.receive_time, *rate * config_.yaw_rate.unit_radps};
    yaw_rate_->Add(frame.receive_time, last_yaw_rate_->second);
  }
}

std::optional<double> WheelOdometry::SteeringAt(MonotonicTime time) const {
  if (!steering_signal_) return std::nullopt;
  auto measured = steering_signal_->ValueAt(time);
  if (!measured) return std::nullopt;
  if (steering_fraction_) {
    const auto fraction = steering_fraction_->ValueAt(time);
    if (!fraction) return std::nullopt;
    *measured += *fraction;
  }
  return config_.steering.WheelAngle(*measured);
}

std::optional<OdometryIncrement> WheelOdometry::Handle(const CanFrame& frame) {
  HandleSensors(frame);
  last_sample_ = signals_.Handle(frame);
  if (!last_sample_) return std::nullopt;
  const WheelSample& sample = *last_sample_;
  ++counters_.samples;
  if (sample.refused_frames > 0) pending_flags_ |= kOdometryChecksum;
  if (sample.missing_frames > 0) pending_flags_ |= kOdometryGap;
  if (!anchor_) return Begin(sample);
  if (sample.time <= anchor_->sample.time) return HandleOld(sample);
  old_in_a_row_ = 0;

  const double duration_s = ToSeconds(sample.time - anchor_->sample.time);
  if (IsAmbiguous(duration_s)) {
    pending_flags_ |= kOdometryGap;
    return Accept(sample, Extrapolate(duration_s));
  }
  if (const auto travel = MeasuredTravel(anchor_->sample, sample)) return Accept(sample, *travel);

  pending_flags_ |= kOdometryJump;
  ++counters_.jumps;
  // Counters that agree with those refused before, and not with those accepted, were set anew.
  const bool were_reset = signals_.are_ticks() && suspect_ && suspect_->time < sample.time &&
                          MeasuredTravel(*suspect_, sample);
  if (were_reset) return Accept(sample, Extrapolate(duration_s));
  suspect_ = sample;
  return std::nullopt;
}

std::optional<OdometryIncrement> WheelOdometry::HandleOld(const WheelSample& sample) {
  ++counters_.out_of_order;
  old_in_a_row_ = sample.time > last_old_time_ ? old_in_a_row_ + 1 : 1;
  last_old_time_ = sample.time;
  if (old_in_a_row_ < kOldAreNew) return std::nullopt;
  ++counters_.clock_jumps;
  old_in_a_row_ = 0;
  suspect_.reset();
  still_since_.reset();
  is_guess_ = false;
  guessed_covariance_.setZero();
  disagreement_rad_ = disagreement_variance_ = 0.0;
  if (yaw_rate_) yaw_rate_->Restart();
  pending_flags_ |= kOdometryJump;
  return Begin(sample);
}

OdometryIncrement WheelOdometry::Begin(const WheelSample& sample) {
  Anchor anchor{.sample = sample, .X_OB = X_OB_};
  if (signals_.are_ticks()) {
    for (std::size_t i = 0; i < 2; ++i)
      anchor.ticks.at(i) = static_cast<std::int64_t>(sample.ticks.at(i));
  } else {
    anchor.speeds_mps = ScaledSpeeds(sample);
    anchor.has_speeds = true;
  }
  anchor_ = anchor;
  time_ = sample.time;
  if (yaw_rate_) yaw_rate_->TurnTo(sample.time);
  // No time has passed; a covariance of zero would have no inverse.
  const BodyMotion none = MotionFromTravel(config_.drive, {.duration_s = config_.max_interval_s});
  return Publish(sample.time, none, std::exchange(pending_flags_, 0));
}

std::optional<OdometryIncrement> WheelOdometry::Accept(const WheelSample& sample,
                                                       const WheelTravel& travel) {
  suspect_.reset();
  std::int32_t flags = std::exchange(pending_flags_, 0);
  if (travel.duration_s > config_.max_interval_s) flags |= kOdometryGap;
  std::optional<TurnMeasurement> turn;
  if (yaw_rate_) turn = yaw_rate_->TurnTo(sample.time);
  const CarMeasurement measured = Measurement(sample, travel, turn);
  const bool disagrees = Disagrees(measured);
  if (IsSlipping(sample, travel) || disagrees) flags |= kOdometrySlip;
  if (UpdateStandstill(sample, travel) && IsStandstill(sample, disagrees))
    flags |= kOdometryStandstill;
  if ((flags & kOdometryGap) != 0) ++counters_.gaps;
  if ((flags & kOdometrySlip) != 0) ++counters_.slips;

  BodyMotion motion = Motion(measured, (flags & kOdometryGap) != 0, (flags & kOdometrySlip) != 0);
  MoveAnchor(sample, travel, motion.X_BiBj);
  if (!is_guess_) return Publish(sample.time, motion, flags);

  // The guesses that were published meanwhile are taken back in part: what they had wrong is in
  // this motion now.
  guessed_covariance_ += motion.covariance;
  if (sample.time <= time_) {
    pending_flags_ = flags & ~kOdometryStandstill;
    return std::nullopt;
  }
  motion.X_BiBj = X_OB_.Inverse() * anchor_->X_OB;
  motion.covariance = std::exchange(guessed_covariance_, Eigen::Matrix3d::Zero());
  is_guess_ = false;
  return Publish(sample.time, motion, flags);
}

void WheelOdometry::MoveAnchor(const WheelSample& sample,
                               const WheelTravel& travel,
                               const Pose2& X_BiBj) {
  if (signals_.are_ticks()) {
    const std::array<int, 2> bits = signals_.counter_bits();
    for (std::size_t i = 0; i < 2; ++i) {
      anchor_->ticks.at(i) +=
          TickDifference(anchor_->sample.ticks.at(i), sample.ticks.at(i), bits.at(i));
    }
  }
  anchor_->speeds_mps = SpeedsAt(sample, travel);
  anchor_->has_speeds = true;
  anchor_->sample = sample;
  anchor_->X_OB = anchor_->X_OB * X_BiBj;
}

OdometryIncrement WheelOdometry::Publish(MonotonicTime time,
                                         const BodyMotion& motion,
                                         std::int32_t flags) {
  X_OB_ = is_guess_ ? X_OB_ * motion.X_BiBj : anchor_->X_OB;
  Eigen::Vector3d twist = BodyTwist(config_.drive.track_m, anchor_->speeds_mps);
  if (is_guess_) {
    twist = motion.X_BiBj.Log() / ToSeconds(time - time_);
  } else if (!uses_only_rear() && time > time_) {
    twist.z() = motion.X_BiBj.yaw() / std::max(ToSeconds(time - time_), ShortestInterval());
  }
  OdometryIncrement increment{.previous_time = std::exchange(time_, time),
                              .time = time,
                              .X_BiBj = motion.X_BiBj,
                              .covariance = motion.covariance,
                              .X_OB = X_OB_,
                              .speed_mps = twist.x(),
                              .yaw_rate_radps = twist.z(),
                              .flags = flags,
                              .ticks = std::nullopt};
  if (signals_.are_ticks()) increment.ticks = anchor_->ticks;
  return increment;
}

std::optional<OdometryIncrement> WheelOdometry::Tick(MonotonicTime now) {
  if (!anchor_) return std::nullopt;
  const Duration age = now - anchor_->sample.time;
  if (age <= FromSeconds(config_.stale_after_s)) return std::nullopt;
  if (now - time_ < FromSeconds(config_.stale_period_s)) return std::nullopt;

  const WheelTravel before = Extrapolate(ToSeconds(time_ - anchor_->sample.time));
  const WheelTravel after = Extrapolate(ToSeconds(age));
  const BodyMotion motion =
      MotionFromTravel(config_.drive,
                       {.travel_m = after.travel_m - before.travel_m,
                        .variance_m2 = (after.variance_m2 - before.variance_m2).cwiseMax(0.0),
                        .duration_s = ToSeconds(now - time_)});
  is_guess_ = true;
  guessed_covariance_ += motion.covariance;
  ++counters_.guesses;
  return Publish(now, motion, kOdometryStale);
}

std::optional<WheelTravel> WheelOdometry::MeasuredTravel(const WheelSample& from,
                                                         const WheelSample& to) const {
  const WheelTravel travel =
      signals_.are_ticks() ? TravelFromTicks(from, to) : TravelFromSpeeds(from, to);
  const double fastest = signals_.are_ticks() ? travel.travel_m.cwiseAbs().maxCoeff() /
                                                    JudgedInterval(travel.duration_s)
                                              : ScaledSpeeds(to).cwiseAbs().maxCoeff();
  if (!(fastest <= config_.max_speed_mps)) return std::nullopt;
  return travel;
}

WheelTravel WheelOdometry::TravelFromTicks(const WheelSample& from, const WheelSample& to) const {
  const std::array<int, 2> bits = signals_.counter_bits();
  const Eigen::Vector2d metres_per_tick = MetresPerTick();
  const Eigen::Vector2d ticks(
      static_cast<double>(TickDifference(from.ticks[0], to.ticks[0], bits[0])),
      static_cast<double>(TickDifference(from.ticks[1], to.ticks[1], bits[1])));
  return {.travel_m = metres_per_tick.cwiseProduct(ticks),
          // The difference of two roundings, each uniform within a tick.
          .variance_m2 = metres_per_tick.cwiseAbs2() / 6.0,
          .duration_s = ToSeconds(to.time - from.time)};
}

WheelTravel WheelOdometry::TravelFromSpeeds(const WheelSample& from, const WheelSample& to) const {
  const double duration_s = ToSeconds(to.time - from.time);
  const std::array<double, 2> resolution = signals_.speed_resolution_mps();
  const Eigen::Vector2d rounding_m = duration_s * Eigen::Vector2d(resolution[0], resolution[1]);
  return {.travel_m = 0.5 * duration_s * (ScaledSpeeds(from) + ScaledSpeeds(to)),
          .variance_m2 = rounding_m.cwiseAbs2() / 12.0,
          .duration_s = duration_s,
          .front_m = FrontTravel(from, to)};
}

std::optional<Eigen::Vector2d> WheelOdometry::FrontTravel(const WheelSample& from,
                                                          const WheelSample& to) const {
  if (!signals_.has_front()) return std::nullopt;
  const double half_s = 0.5 * ToSeconds(to.time - from.time);
  const DifferentialDriveConfig& drive = config_.drive;
  return Eigen::Vector2d(
      drive.front_left_scale * half_s * (from.front_speeds_mps[0] + to.front_speeds_mps[0]),
      drive.front_right_scale * half_s * (from.front_speeds_mps[1] + to.front_speeds_mps[1]));
}

WheelTravel WheelOdometry::Extrapolate(double duration_s) const {
  const double kept_s = std::min(duration_s, config_.extrapolate_s);
  const double changed_m = std::min(0.5 * config_.unknown_acceleration_mps2 * Square(duration_s),
                                    config_.max_speed_mps * duration_s);
  const Eigen::Vector2d not_kept_m = anchor_->speeds_mps.cwiseAbs() * (duration_s - kept_s);
  return {.travel_m = anchor_->speeds_mps * kept_s,
          .variance_m2 = (not_kept_m.array() + changed_m).square().matrix(),
          .duration_s = duration_s};
}

bool WheelOdometry::IsAmbiguous(double duration_s) const {
  if (!signals_.are_ticks()) return false;
  const double furthest_m = config_.max_speed_mps * JudgedInterval(duration_s);
  const Eigen::Vector2d metres_per_tick = MetresPerTick();
  const std::array<int, 2> bits = signals_.counter_bits();
  for (std::size_t i = 0; i < 2; ++i) {
    const double ticks = furthest_m / std::abs(metres_per_tick[static_cast<Eigen::Index>(i)]);
    if (ticks >= static_cast<double>(MaxTickDifference(bits.at(i)))) return true;
  }
  return false;
}

bool WheelOdometry::IsSlipping(const WheelSample& sample, const WheelTravel& travel) const {
  const double interval_s = JudgedInterval(travel.duration_s);
  const Eigen::Vector3d twist = BodyTwist(config_.drive.track_m, travel.travel_m / interval_s);
  if (std::abs(twist.z()) > config_.max_yaw_rate_radps) return true;

  const Eigen::Vector2d speeds_mps = SpeedsAt(sample, travel);
  const double change = (speeds_mps - anchor_->speeds_mps).cwiseAbs().maxCoeff();
  if (anchor_->has_speeds && change > config_.max_acceleration_mps2 * interval_s) return true;

  if (!signals_.has_front()) return false;
  const double front = 0.5 * (config_.drive.front_left_scale * sample.front_speeds_mps[0] +
                              config_.drive.front_right_scale * sample.front_speeds_mps[1]);
  const double rear = speeds_mps.mean();
  const double faster = std::max(std::abs(front), std::abs(rear));
  return std::abs(front - rear) > config_.max_axle_difference * faster + kAxleDifference;
}

CarMeasurement WheelOdometry::Measurement(const WheelSample& sample,
                                          const WheelTravel& travel,
                                          const std::optional<TurnMeasurement>& turn) const {
  CarMeasurement measured{.rear = travel, .turn = turn};
  if (config_.model == "differential") return measured;
  if (config_.model == "four_wheel") measured.front_m = travel.front_m;
  measured.steering_rad = SteeringAt(sample.time);
  measured.steering_sigma_rad = config_.steering.sigma_rad;
  // Without any other the wheels' difference is better than nothing.
  const bool is_turn_known = measured.steering_rad || measured.turn;
  measured.uses_rear_difference = config_.model == "four_wheel" || !is_turn_known;
  return measured;
}

bool WheelOdometry::Disagrees(const CarMeasurement& measured) {
  const DifferentialDriveConfig& drive = config_.drive;
  const WheelTravel& rear = measured.rear;
  std::optional<TurnMeasurement> turn = measured.turn;
  if (!turn && measured.steering_rad) turn = TurnBySteering(drive, measured, rear.travel_m.mean());
  if (turn) {
    const double wheels_rad = BodyTwist(drive.track_m, rear.travel_m).z();
    const double wheels_variance =
        (Square(drive.wheel_sigma_m_per_sqrt_m) * rear.travel_m.cwiseAbs() + rear.variance_m2)
            .sum() /
        Square(drive.track_m);
    const double kept = std::exp(-rear.duration_s / kAgreementS);
    disagreement_rad_ = kept * disagreement_rad_ + wheels_rad - turn->turn_rad;
    disagreement_variance_ =
        Square(kept) * disagreement_variance_ + wheels_variance + turn->variance_rad2;
    const double allowed_rad =
        config_.max_deviation_sigma * std::sqrt(disagreement_variance_) + kAgreementRad;
    if (std::abs(disagreement_rad_) > allowed_rad) return true;
  }
  return measured.front_m &&
         SolveCarTravel(config_.drive, measured).worst_residual > config_.max_deviation_sigma;
}

BodyMotion WheelOdometry::Motion(CarMeasurement measured, bool is_gap, bool is_slipping) const {
  const double acceleration = config_.unknown_acceleration_mps2;
  WheelTravel& travel = measured.rear;
  const double squared_s2 = Square(travel.duration_s);
  if (is_slipping) {
    const double slip_m = config_.slip_sigma * travel.travel_m.cwiseAbs().maxCoeff();
    travel.variance_m2.array() += Square(slip_m);
  }
  if (is_gap && !signals_.are_ticks()) {
    // How far off the trapezoid of two speeds can be if the wheel sped up and down again between.
    travel.variance_m2.array() += Square(0.25 * acceleration * squared_s2);
  }
  BodyMotion motion =
      uses_only_rear()
          ? MotionFromTravel(config_.drive, travel)
          : MotionFromBodyTravel(
                config_.drive, SolveCarTravel(config_.drive, measured), travel.duration_s);
  if (is_gap) {
    // The heading may have gone another way than evenly: off by up to alpha T^2 / 8 in the middle,
    // which moves the end sideways by two thirds of that per metre.
    const double yaw_acceleration = 2.0 * acceleration / config_.drive.track_m;
    const double off_rad = std::min(yaw_acceleration * squared_s2 / 12.0, std::numbers::pi);
    motion.covariance(1, 1) += Square(travel.travel_m.mean() * off_rad);
  }
  return motion;
}

bool WheelOdometry::UpdateStandstill(const WheelSample& sample, const WheelTravel& travel) {
  const bool is_still =
      signals_.are_ticks()
          ? sample.ticks == anchor_->sample.ticks && travel.travel_m.isZero(0.0)
          : ScaledSpeeds(sample).cwiseAbs().maxCoeff() <= config_.standstill_speed_mps;
  if (!is_still) {
    still_since_.reset();
    return false;
  }
  if (!still_since_) still_since_ = anchor_->sample.time;
  return sample.time - *still_since_ >= FromSeconds(config_.standstill_after_s);
}

bool WheelOdometry::IsStandstill(const WheelSample& sample, bool disagrees) {
  if (!yaw_rate_) return true;
  if (disagrees || yaw_rate_->IsUnlikeBias(config_.max_deviation_sigma)) {
    if (sample.time - *still_since_ < FromSeconds(kUnseenTurnS)) return false;
    yaw_rate_->DoubtBias();
  }
  yaw_rate_->LearnBias();
  return true;
}

Eigen::Vector2d WheelOdometry::ScaledSpeeds(const WheelSample& sample) const {
  return {sample.speeds_mps[0] * config_.drive.left_scale,
          sample.speeds_mps[1] * config_.drive.right_scale};
}

/// Frames that wait together are stamped closer to each other than they were measured, so that
/// ticks over their time would be any speed.
Eigen::Vector2d WheelOdometry::SpeedsAt(const WheelSample& sample,
                                        const WheelTravel& travel) const {
  if (!signals_.are_ticks()) return ScaledSpeeds(sample);
  return travel.travel_m / std::max(travel.duration_s, ShortestInterval());
}

double WheelOdometry::ShortestInterval() const {
  constexpr double kShortest = 0.2;  // of the longest interval that is regular
  return kShortest * config_.max_interval_s;
}

Eigen::Vector2d WheelOdometry::MetresPerTick() const {
  const double turn = 2.0 * std::numbers::pi / config_.drive.ticks_per_revolution;
  return {turn * config_.drive.left_radius_m * config_.drive.left_scale,
          turn * config_.drive.right_radius_m * config_.drive.right_scale};
}

double WheelOdometry::JudgedInterval(double duration_s) const {
  return std::max(duration_s, config_.max_interval_s);
}

}  // namespace relocd
