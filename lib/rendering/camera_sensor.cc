#include "rendering/camera_sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "core/counter_random.h"
#include "rendering/texture.h"

namespace relocd {
namespace {

Error OutOfRange(const char* name, double value, const char* allowed) {
  return {ErrorKind::kInvalidInput, fmt::format("{} is {}, must be {}", name, value, allowed)};
}

/// sRGB of linear light in [0, 1], by table: finer than 8 bits everywhere.
class SrgbTable {
 public:
  SrgbTable() {
    for (std::size_t i = 0; i < table_.size(); ++i) {
      // By the square, so that dark values, where sRGB is steep, are finely divided.
      const float root = (static_cast<float>(i) + 0.5F) / static_cast<float>(kSize);
      table_.at(i) = static_cast<std::uint8_t>(std::lround(SrgbFromLinear(root * root)));
    }
  }

  [[nodiscard]] std::uint8_t At(float linear) const {
    const float root = std::sqrt(std::clamp(linear, 0.0F, 1.0F));
    return table_[static_cast<std::size_t>(root * static_cast<float>(kSize))];
  }

 private:
  static constexpr std::size_t kSize = 4096;
  std::array<std::uint8_t, kSize + 1> table_{};
};

/// Draws of a standard normal distribution, from a table of its quantiles.
class NormalTable {
 public:
  NormalTable() {
    double sum_of_squares = 0.0;
    for (std::size_t i = 0; i < table_.size(); ++i) {
      const double probability =
          (static_cast<double>(i) + 0.5) / static_cast<double>(table_.size());
      table_.at(i) = static_cast<float>(Quantile(probability));
      sum_of_squares += Square(table_.at(i));
    }
    // The ends, which the table cuts off, carry a little of the variance.
    const double sigma = std::sqrt(sum_of_squares / static_cast<double>(table_.size()));
    for (float& value : table_)
      value = static_cast<float>(value / sigma);
  }

  /// One draw for each 12 bits.
  [[nodiscard]] float At(std::uint64_t bits) const { return table_[bits & (kSize - 1)]; }

 private:
  static constexpr std::size_t kSize = 4096;

  static double Square(double x) { return x * x; }

  /// By bisection of the distribution function.
  static double Quantile(double probability) {
    double low = -5.0;
    double high = 5.0;
    constexpr int kSteps = 40;
    for (int i = 0; i < kSteps; ++i) {
      const double middle = 0.5 * (low + high);
      const double below = 0.5 * std::erfc(-middle / std::numbers::sqrt2);
      (below < probability ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }

  std::array<float, kSize> table_{};
};

}  // namespace

Result<void> CameraSensorOptions::Validate() const {
  if (!(electrons_per_radiance_s > 0.0 && std::isfinite(electrons_per_radiance_s)))
    return OutOfRange("electrons_per_radiance_s", electrons_per_radiance_s, "> 0");
  if (!(full_well_electrons >= 100.0 && std::isfinite(full_well_electrons)))
    return OutOfRange("full_well_electrons", full_well_electrons, ">= 100");
  if (!(read_noise_electrons >= 0.0 && std::isfinite(read_noise_electrons)))
    return OutOfRange("read_noise_electrons", read_noise_electrons, ">= 0");
  if (!(vignetting >= 0.0 && vignetting < 1.0))
    return OutOfRange("vignetting", vignetting, "in [0, 1)");
  return {};
}

float CameraSensor::VignettingAt(int u, int v, int width, int height) const {
  const float x = 2.0F * (static_cast<float>(u) + 0.5F) / static_cast<float>(width) - 1.0F;
  const float y = 2.0F * (static_cast<float>(v) + 0.5F) / static_cast<float>(height) - 1.0F;
  const float radius_squared = 0.5F * (x * x + y * y);  // 1 in the corners
  return 1.0F - static_cast<float>(options_.vignetting) * radius_squared * radius_squared;
}

RgbImage CameraSensor::Develop(const LinearImage& radiance,
                               const Exposure& exposure,
                               std::uint64_t seed,
                               int threads) const {
  RgbImage image{.width = radiance.width, .height = radiance.height, .pixels = {}};
  image.pixels.resize(3 * radiance.pixels.size());
  std::vector<std::jthread> workers;
  for (int i = 0; i < threads; ++i) {
    const int begin = radiance.height * i / threads;
    const int end = radiance.height * (i + 1) / threads;
    workers.emplace_back([this, &radiance, &exposure, seed, begin, end, &image] {
      for (int v = begin; v < end; ++v)
        DevelopRow(radiance, exposure, CounterRandom(seed), v, image);
    });
  }
  return image;
}

void CameraSensor::DevelopRow(const LinearImage& radiance,
                              const Exposure& exposure,
                              const CounterRandom& random,
                              int v,
                              RgbImage& image) const {
  static const SrgbTable srgb;
  static const NormalTable normal;
  const auto per_radiance = static_cast<float>(options_.electrons_per_radiance_s * exposure.time_s);
  const auto to_white = static_cast<float>(exposure.gain / options_.full_well_electrons);
  const auto read_variance =
      static_cast<float>(options_.read_noise_electrons * options_.read_noise_electrons);
  std::size_t pixel = static_cast<std::size_t>(v) * static_cast<std::size_t>(radiance.width);
  for (int u = 0; u < radiance.width; ++u, ++pixel) {
    const float light = per_radiance * VignettingAt(u, v, radiance.width, radiance.height);
    std::uint64_t bits = random.Bits(pixel);
    for (std::size_t c = 0; c < 3; ++c) {
      const float mean = light * radiance.pixels[pixel][static_cast<Eigen::Index>(c)];
      // The normal distribution stands in for Poisson's, which it is close to from some tens on.
      const float sigma = std::sqrt(std::max(mean, 0.0F) + read_variance);
      image.pixels[3 * pixel + c] = srgb.At(to_white * (mean + sigma * normal.At(bits)));
      bits >>= 12U;
    }
  }
}

Exposure AutoExposure::Next(const LinearImage& radiance, double time_s) {
  // The sky counts less: cameras weigh the lower part of the image more.
  double sum = 0.0;
  double weights = 0.0;
  const double white = sensor_.full_well_electrons / sensor_.electrons_per_radiance_s;
  for (int v = 0; v < radiance.height; v += 4) {
    const double weight = v < radiance.height / 3 ? 0.25 : 1.0;
    for (int u = 0; u < radiance.width; u += 4) {
      const Eigen::Array3f& pixel = radiance.At(u, v);
      const double luminance = 0.25 * pixel[0] + 0.6 * pixel[1] + 0.15 * pixel[2];
      // A few very bright lamps must not darken everything.
      sum += weight * std::min(luminance, 8.0);
      weights += weight;
    }
  }
  const double mean = std::max(sum / weights, 1e-6);
  const double wanted = std::log(options_.target * white / mean);
  log_product_ =
      has_product_ ? log_product_ + options_.smoothing * (wanted - log_product_) : wanted;
  has_product_ = true;
  const double swing = options_.hunting_stops * std::numbers::ln2 *
                       std::sin(2.0 * std::numbers::pi * time_s / options_.hunting_period_s);
  const double product = std::exp(log_product_ + swing);
  Exposure exposure;
  exposure.time_s = std::clamp(product, options_.min_time_s, options_.max_time_s);
  exposure.gain = std::clamp(product / exposure.time_s, 1.0, options_.max_gain);
  last_time_s_ = exposure.time_s;
  return exposure;
}

}  // namespace relocd
