#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "can/can_frame.h"
#include "can/dbc.h"
#include "can/message_guard.h"
#include "can/signal_reader.h"
#include "core/result.h"
#include "core/time.h"
#include "geometry/pose2.h"
#include "odometry/car_travel.h"
#include "odometry/differential_drive.h"
#include "odometry/turn_sensors.h"
#include "odometry/wheel_signals.h"

namespace relocd {

struct OdometryConfig {
  std::string model = "differential";
  WheelSignalsConfig wheels{};
  DifferentialDriveConfig drive{};
  SteeringConfig steering{};
  YawRateConfig yaw_rate{};
  double max_interval_s = 0.05;
  double stale_after_s = 0.2;
  double stale_period_s = 0.1;
  double extrapolate_s = 0.5;
  double max_speed_mps = 5.0;
  double max_yaw_rate_radps = 6.0;
  double max_acceleration_mps2 = 20.0;
  double max_axle_difference = 0.3;
  double max_deviation_sigma = 6.0;
  double slip_sigma = 0.3;
  double unknown_acceleration_mps2 = 1.0;
  double standstill_speed_mps = 0.02;
  double standstill_after_s = 0.3;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("model",
          self.model,
          "differential (left and right wheel), ackermann (their mean, and the steering) or "
          "four_wheel (least squares of four wheels, and of the steering if there is one); a "
          "yaw-rate sensor takes part in each");
    visit("wheels", self.wheels, "The signals of the wheels in the DBC file.");
    visit("drive", self.drive, "The geometry of the wheels, and how well they measure.");
    visit("steering", self.steering, "A sensor of the steering's angle.");
    visit("yaw_rate", self.yaw_rate, "A sensor of the yaw rate.");
    visit("max_interval_s",
          self.max_interval_s,
          "> 0; two measurements further apart are a gap, and their covariance is inflated");
    visit("stale_after_s",
          self.stale_after_s,
          ">= max_interval_s; without a measurement for longer, guessed ones are published");
    visit("stale_period_s", self.stale_period_s, "> 0; between two guessed measurements");
    visit("extrapolate_s",
          self.extrapolate_s,
          ">= 0; for how long a guess takes the wheels to keep their speed");
    visit(
        "max_speed_mps", self.max_speed_mps, "> 0; a wheel that goes faster is refused as a jump");
    visit("max_yaw_rate_radps",
          self.max_yaw_rate_radps,
          "> 0; wheels that turn the body faster are slipping");
    visit("max_acceleration_mps2",
          self.max_acceleration_mps2,
          "> 0; a wheel that changes its speed faster is slipping");
    visit("max_axle_difference",
          self.max_axle_difference,
          "> 0; front and rear axle whose speeds differ by more than this part are slipping");
    visit("max_deviation_sigma",
          self.max_deviation_sigma,
          "> 0; wheels and yaw rate, or four wheels, that disagree by more of their standard "
          "deviations are slipping");
    visit("slip_sigma", self.slip_sigma, "> 0; of the travel of a slipping wheel, as part of it");
    visit("unknown_acceleration_mps2",
          self.unknown_acceleration_mps2,
          "> 0; what the wheels may do unseen: inflates the covariance of gaps and guesses");
    visit("standstill_speed_mps",
          self.standstill_speed_mps,
          ">= 0; wheels that report at most this speed stand");
    visit("standstill_after_s",
          self.standstill_after_s,
          ">= 0; for so long they must, to be flagged");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// What an increment is flagged with. The numbers are those of odometry_t.
enum OdometryFlag : std::int32_t {
  kOdometryStale = 1,
  kOdometryGap = 2,
  kOdometryChecksum = 4,
  kOdometrySlip = 8,
  kOdometryJump = 16,
  kOdometryStandstill = 32,
};

/// How the body moved since the increment before.
struct OdometryIncrement {
  MonotonicTime previous_time{};  ///< Of the increment before; `time` itself in the first.
  MonotonicTime time{};
  Pose2 X_BiBj;                                          ///< The motion in between.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< 3x3 of its right perturbation.
  Pose2 X_OB;              ///< All motions composed, from where the first increment found the body.
  double speed_mps = 0.0;  ///< Forward, of B's origin.
  double yaw_rate_radps = 0.0;
  std::int32_t flags = 0;                            ///< A sum of OdometryFlag.
  std::optional<std::array<std::int64_t, 2>> ticks;  ///< Unwrapped, left and right.
};

/// Turns CAN frames into motion increments: WheelSignals -> plausibility -> MotionFromTravel.
///
/// Increments follow each other without a hole: composed, they give X_OB. While no measurement
/// comes, Tick guesses increments whose covariance grows fast; the first measurement after that
/// takes back what the guesses had wrong (ticks also tell how far the wheels went meanwhile), with
/// a covariance that covers it. Measurements that go on at an earlier time, as those of another
/// boot, are refused as out of order, until there are so many that it begins anew with them.
///
/// Thread-bound; reads no clock.
class WheelOdometry {
 public:
  /// @param rules  how messages show that they are new and whole.
  /// @return kInvalidInput, as Validate and WheelSignals::Create.
  static Result<WheelOdometry> Create(const OdometryConfig& config,
                                      const DbcFile& dbc,
                                      const WheelSignals::Rules& rules = {});

  /// The increment that this frame completes. The first measurement gives one without motion.
  std::optional<OdometryIncrement> Handle(const CanFrame& frame);

  /// A guessed increment, flagged stale, when measurements are missing for too long.
  std::optional<OdometryIncrement> Tick(MonotonicTime now);

  /// The measurements that the last frame given to Handle completed, accepted or not.
  [[nodiscard]] const std::optional<WheelSample>& last_sample() const { return last_sample_; }
  [[nodiscard]] const WheelSignals& signals() const { return signals_; }
  /// The frames that it needs, each once.
  [[nodiscard]] std::vector<CanId> ids() const;
  /// Of all these frames: wheels, steering and yaw rate.
  [[nodiscard]] MessageGuard::Counters frame_counters() const;
  /// What the yaw-rate sensor is taken to report when nothing turns.
  [[nodiscard]] std::optional<double> yaw_rate_bias_radps() const;
  /// Of a front wheel in the middle, if it is measured and not too old.
  [[nodiscard]] std::optional<double> SteeringAt(MonotonicTime time) const;
  /// The last yaw rate, in rad/s without correction, and its time.
  [[nodiscard]] const std::optional<std::pair<MonotonicTime, double>>& last_yaw_rate() const {
    return last_yaw_rate_;
  }

  struct Counters {
    std::int64_t samples = 0;       ///< Sets of measurements, accepted or not.
    std::int64_t gaps = 0;          ///< Increments that bridge missing measurements.
    std::int64_t jumps = 0;         ///< Sets refused as implausible.
    std::int64_t slips = 0;         ///< Increments of slipping wheels.
    std::int64_t out_of_order = 0;  ///< Sets refused, since their time did not increase.
    std::int64_t clock_jumps = 0;   ///< The measurements went on at an earlier time: began anew.
    std::int64_t guesses = 0;       ///< Increments made by Tick.
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  /// The last measurement that was accepted, and what follows from it.
  struct Anchor {
    WheelSample sample;
    Eigen::Vector2d speeds_mps = Eigen::Vector2d::Zero();  ///< Of the wheels, scaled.
    bool has_speeds = false;                               ///< One reading of ticks has none.
    std::array<std::int64_t, 2> ticks{};                   ///< Unwrapped.
    Pose2 X_OB{};
  };

  WheelOdometry(const OdometryConfig& config, WheelSignals signals)
      : config_(config), signals_(std::move(signals)) {}

  Result<void> AddSensors(const DbcFile& dbc, const WheelSignals::Rules& rules);
  void HandleSensors(const CanFrame& frame);
  [[nodiscard]] bool uses_only_rear() const {
    return config_.model == "differential" && !yaw_rate_;
  }

  OdometryIncrement Begin(const WheelSample& sample);
  std::optional<OdometryIncrement> HandleOld(const WheelSample& sample);
  std::optional<OdometryIncrement> Accept(const WheelSample& sample, const WheelTravel& travel);
  void MoveAnchor(const WheelSample& sample, const WheelTravel& travel, const Pose2& X_BiBj);
  OdometryIncrement Publish(MonotonicTime time, const BodyMotion& motion, std::int32_t flags);

  /// The travel that two measurements tell; nothing when they cannot both be right, or the counters
  /// may have gone round.
  [[nodiscard]] std::optional<WheelTravel> MeasuredTravel(const WheelSample& from,
                                                          const WheelSample& to) const;
  [[nodiscard]] WheelTravel TravelFromTicks(const WheelSample& from, const WheelSample& to) const;
  [[nodiscard]] WheelTravel TravelFromSpeeds(const WheelSample& from, const WheelSample& to) const;
  [[nodiscard]] std::optional<Eigen::Vector2d> FrontTravel(const WheelSample& from,
                                                           const WheelSample& to) const;
  /// A guess of the travel within `duration_s` after the anchor.
  [[nodiscard]] WheelTravel Extrapolate(double duration_s) const;
  /// Whether a counter may have gone round more than half its range.
  [[nodiscard]] bool IsAmbiguous(double duration_s) const;
  [[nodiscard]] bool IsSlipping(const WheelSample& sample, const WheelTravel& travel) const;
  /// The motion, with a covariance that covers what was not seen of it, or slipped.
  [[nodiscard]] BodyMotion Motion(CarMeasurement measured, bool is_gap, bool is_slipping) const;
  [[nodiscard]] CarMeasurement Measurement(const WheelSample& sample,
                                           const WheelTravel& travel,
                                           const std::optional<TurnMeasurement>& turn) const;
  /// Whether the wheels contradict the yaw rate, the steering, or each other.
  bool Disagrees(const CarMeasurement& measured);
  bool UpdateStandstill(const WheelSample& sample, const WheelTravel& travel);
  /// Whether a body whose wheels stand does so, too; learns the yaw rate's bias if it does.
  bool IsStandstill(const WheelSample& sample, bool disagrees);

  [[nodiscard]] Eigen::Vector2d ScaledSpeeds(const WheelSample& sample) const;
  [[nodiscard]] Eigen::Vector2d SpeedsAt(const WheelSample& sample,
                                         const WheelTravel& travel) const;
  [[nodiscard]] Eigen::Vector2d MetresPerTick() const;
  /// The shortest interval over which a rate is judged. Frames that wait together are stamped
  /// closer to each other than they were measured.
  [[nodiscard]] double JudgedInterval(double duration_s) const;
  /// Less than this between two frames is taken to be the reception's doing.
  [[nodiscard]] double ShortestInterval() const;

  OdometryConfig config_;
  WheelSignals signals_;
  std::optional<SignalReader> steering_signal_;
  std::optional<SignalReader> steering_fraction_;
  std::optional<SignalReader> yaw_rate_signal_;
  std::optional<YawRateSensor> yaw_rate_;
  std::optional<std::pair<MonotonicTime, double>> last_yaw_rate_;
  /// Turn by the wheels less that by the yaw rate, or by the steering, over the last half second,
  /// and its variance.
  double disagreement_rad_ = 0.0;
  double disagreement_variance_ = 0.0;
  std::optional<WheelSample> last_sample_;
  std::optional<Anchor> anchor_;
  std::optional<WheelSample> suspect_;  ///< The last set that was refused as a jump.
  MonotonicTime last_old_time_{};       ///< Of the last set that was refused as out of order.
  int old_in_a_row_ = 0;                ///< Of them, by rising time.
  std::optional<MonotonicTime> still_since_;

  MonotonicTime time_{};  ///< Of the last increment.
  Pose2 X_OB_;            ///< Of the last increment: the anchor's, or a guess.
  bool is_guess_ = false;
  Eigen::Matrix3d guessed_covariance_ = Eigen::Matrix3d::Zero();  ///< Of the guesses since.
  std::int32_t pending_flags_ = 0;                                ///< For the next increment.
  Counters counters_;
};

}  // namespace relocd
