#pragma once

#include <cstdint>

#include "camera/image.h"
#include "core/counter_random.h"
#include "core/result.h"
#include "rendering/linear_image.h"

namespace relocd {

/// How a camera turns light into numbers.
struct CameraSensorOptions {
  double electrons_per_radiance_s = 5e6;  ///< Of a pixel that sees a radiance of 1 for 1 s.
  double full_well_electrons = 8000.0;    ///< Above this a pixel is white.
  double read_noise_electrons = 5.0;      ///< Standard deviation.
  double vignetting = 0.35;               ///< Part of the light lost in the corners, in [0, 1).

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// What the camera was set to for one image.
struct Exposure {
  double time_s = 0.004;
  double gain = 1.0;  ///< >= 1
};

/// Turns radiance into an sRGB image: vignetting, shot noise, read noise, gain, the limits of 8
/// bits. Immutable, hence thread-safe.
class CameraSensor {
 public:
  /// @param options  valid.
  explicit CameraSensor(const CameraSensorOptions& options) : options_(options) {}

  /// The same seed gives the same noise.
  ///
  /// @param threads  >= 1
  [[nodiscard]] RgbImage Develop(const LinearImage& radiance,
                                 const Exposure& exposure,
                                 std::uint64_t seed,
                                 int threads = 1) const;

  /// The part of the light that reaches a pixel at (u, v) of a width x height image.
  [[nodiscard]] float VignettingAt(int u, int v, int width, int height) const;

 private:
  void DevelopRow(const LinearImage& radiance,
                  const Exposure& exposure,
                  const CounterRandom& random,
                  int v,
                  RgbImage& image) const;

  CameraSensorOptions options_;
};

struct AutoExposureOptions {
  double max_time_s = 0.008;
  double min_time_s = 0.0001;
  double max_gain = 16.0;
  double target = 0.16;           ///< Mean of the image, as part of white, in linear light.
  double smoothing = 0.25;        ///< Part of the way to the right exposure made at each image.
  double hunting_stops = 0.0;     ///< Amplitude of swinging about it,
  double hunting_period_s = 4.0;  ///< and how long one swing takes.
};

/// Sets the exposure as cameras do: from the images so far, with a delay, by time first and then by
/// gain. Thread-bound.
class AutoExposure {
 public:
  AutoExposure(const CameraSensorOptions& sensor, const AutoExposureOptions& options)
      : sensor_(sensor), options_(options) {}

  /// The exposure for the image that sees `radiance` at `time_s`.
  Exposure Next(const LinearImage& radiance, double time_s);

  /// The exposure that an image without a past would get, as an estimate before it is rendered.
  [[nodiscard]] double last_time_s() const { return last_time_s_; }

 private:
  CameraSensorOptions sensor_;
  AutoExposureOptions options_;
  double log_product_ = 0.0;  ///< Logarithm of time x gain.
  bool has_product_ = false;
  double last_time_s_ = 0.001;
};

}  // namespace relocd
