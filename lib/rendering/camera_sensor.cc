#include "rendering/camera_sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

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
      const float root = static_cast<float>(i) / static_cast<float>(kSize);
      table_.at(i) = SrgbFromLinear(root * root);
    }
  }

  [[nodiscard]] std::uint8_t At(float linear) const {
    const float root = std::sqrt(std::clamp(linear, 0.0F, 1.0F));
    const float value = table_[static_cast<std::size_t>(root * static_cast<float>(kSize) + 0.5F)];
    return static_cast<std::uint8_t>(value + 0.5F);
  }

 private:
  static constexpr std::size_t kSize = 4096;
  std::array<float, kSize + 1> table_{};
};

/// Two independent draws of a standard normal distribution (Box and Muller, 1958).
std::array<float, 2> Normals(const CounterRandom& random, std::uint64_t counter) {
  const std::uint64_t bits = random.Bits(counter);
  constexpr float kUlp = 1.0F / 4294967296.0F;
  const float first = (static_cast<float>(bits >> 32U) + 0.5F) * kUlp;
  const float second = static_cast<float>(bits & 0xFFFFFFFFU) * kUlp;
  const float radius = std::sqrt(-2.0F * std::log(first));
  const float angle = 2.0F * std::numbers::pi_v<float> * second;
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

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
                               std::uint64_t seed) const {
  static const SrgbTable srgb;
  const CounterRandom random(seed);
  const auto per_radiance = static_cast<float>(options_.electrons_per_radiance_s * exposure.time_s);
  const auto to_white = static_cast<float>(exposure.gain / options_.full_well_electrons);
  const auto read_variance =
      static_cast<float>(options_.read_noise_electrons * options_.read_noise_electrons);
  RgbImage image{.width = radiance.width, .height = radiance.height, .pixels = {}};
  image.pixels.resize(3 * radiance.pixels.size());
  std::size_t at = 0;
  for (int v = 0; v < radiance.height; ++v) {
    for (int u = 0; u < radiance.width; ++u) {
      const float light = per_radiance * VignettingAt(u, v, radiance.width, radiance.height);
      const Eigen::Array3f electrons = light * radiance.At(u, v);
      const auto [first, second] = Normals(random, 2 * at);
      const float third = Normals(random, 2 * at + 1)[0];
      const std::array<float, 3> noise{first, second, third};
      for (std::size_t c = 0; c < 3; ++c) {
        const float mean = electrons[static_cast<Eigen::Index>(c)];
        // The normal distribution stands in for Poisson's, which it is close to from some tens on.
        const float sigma = std::sqrt(std::max(mean, 0.0F) + read_variance);
        image.pixels[at++] = srgb.At(to_white * (mean + sigma * noise.at(c)));
      }
    }
  }
  return image;
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
