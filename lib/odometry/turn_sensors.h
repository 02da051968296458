#pragma once

#include <optional>
#include <string>

#include "core/result.h"
#include "core/time.h"

namespace relocd {

/// A sensor of the steering's angle, positive to the left.
struct SteeringConfig {
  std::string signal{};
  std::string fraction_signal{};
  double unit_rad = 0.017453292519943295;
  double ratio = 1.0;
  double offset_rad = 0.0;
  double sigma_rad = 0.01;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("signal", self.signal, "MESSAGE.SIGNAL; empty: there is none");
    visit("fraction_signal", self.fraction_signal, "is added to it; may be empty");
    visit("unit_rad", self.unit_rad, "not 0; of one unit of the signals; negative: positive right");
    visit("ratio",
          self.ratio,
          "> 0; by which the measured angle is more than that of a front wheel in the middle");
    visit("offset_rad", self.offset_rad, "the measured angle when the front wheels look forward");
    visit("sigma_rad",
          self.sigma_rad,
          "> 0; of a front wheel's angle, side slip included, over some metres");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;

  /// Of a front wheel in the middle, from the signals' sum.
  [[nodiscard]] double WheelAngle(double measured) const {
    return (measured * unit_rad - offset_rad) / ratio;
  }
};

/// A sensor of the yaw rate, positive to the left.
struct YawRateConfig {
  std::string signal{};
  double unit_radps = 0.017453292519943295;
  double scale = 1.0;
  double bias_radps = 0.0;
  double bias_sigma_radps = 0.01;
  double bias_walk_radps_per_sqrt_s = 2e-5;
  double noise_rad_per_sqrt_s = 0.001;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("signal", self.signal, "MESSAGE.SIGNAL; empty: there is none");
    visit("unit_radps", self.unit_radps, "not 0; of one unit; negative: positive to the right");
    visit("scale", self.scale, "> 0; corrects the rate, once the bias is taken from it");
    visit("bias_radps", self.bias_radps, "what it reports at the start when nothing turns");
    visit("bias_sigma_radps",
          self.bias_sigma_radps,
          "> 0; how well that is known; it is learned again whenever the wheels stand");
    visit("bias_walk_radps_per_sqrt_s",
          self.bias_walk_radps_per_sqrt_s,
          ">= 0; how far the bias wanders in one second");
    visit("noise_rad_per_sqrt_s", self.noise_rad_per_sqrt_s, "> 0; of the angle after one second");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// How far the body turned, as a sensor other than the wheels has it.
struct TurnMeasurement {
  double turn_rad = 0.0;
  double variance_rad2 = 0.0;
};

/// Integrates a yaw rate between the times of the wheels' measurements, and learns its bias while
/// they stand.
///
/// Thread-bound; reads no clock.
class YawRateSensor {
 public:
  /// @param resolution_radps  between two rates that the signal can tell apart.
  /// @param max_age           a rate is held for so long.
  YawRateSensor(const YawRateConfig& config, double resolution_radps, Duration max_age);

  /// A measured rate, in rad/s without correction. One that is not newer is passed over.
  void Add(MonotonicTime time, double rate_radps);

  /// The turn since the last call, to `time`. Nothing in the first call, and when rates were
  /// missing meanwhile.
  std::optional<TurnMeasurement> TurnTo(MonotonicTime time);

  /// Times go on elsewhere, as after a jump of the clock: forgets all but the bias.
  void Restart();

  /// Whether the rate over the interval of the last TurnTo is further from the bias than so many
  /// standard deviations of both.
  [[nodiscard]] bool IsUnlikeBias(double deviations) const;

  /// The wheels stood in that interval.
  void LearnBias();

  /// The bias may be what the rate is, however well it was known.
  void DoubtBias();

  [[nodiscard]] double bias_radps() const { return bias_radps_; }
  [[nodiscard]] double bias_variance() const { return bias_variance_; }

 private:
  /// Of the rate over the interval of the last TurnTo.
  [[nodiscard]] double RateVariance() const;

  YawRateConfig config_;
  double resolution_radps_;
  Duration max_age_;

  std::optional<MonotonicTime> rate_time_;  ///< Of the last rate.
  double rate_radps_ = 0.0;
  double angle_rad_ = 0.0;  ///< Integrated to rate_time_, without correction.
  bool has_gap_ = false;    ///< Since the last TurnTo.
  bool had_rate_ = false;   ///< At the last TurnTo.

  std::optional<MonotonicTime> turn_time_;  ///< Of the last TurnTo.
  double turn_angle_rad_ = 0.0;             ///< The angle then.
  std::optional<double> last_rate_radps_;   ///< The mean over its interval.
  double last_duration_s_ = 0.0;

  double bias_radps_;
  double bias_variance_;
};

}  // namespace relocd
