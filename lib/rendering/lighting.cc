#include "rendering/lighting.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "core/counter_random.h"

namespace relocd {
namespace {

/// Beyond this, a lamp is not seen to shine.
constexpr float kLampReachM = 22.0F;
constexpr float kGridCellM = 20.0F;

/// The part of the sun's light that comes through the air: Kasten and Young (1989) for the length
/// of its way, optical depths of clear air with some aerosol.
Eigen::Array3f SunTransmission(double elevation_rad) {
  const double elevation_deg = elevation_rad * 180.0 / std::numbers::pi;
  const double air_mass =
      1.0 / (std::sin(elevation_rad) + 0.50572 * std::pow(elevation_deg + 6.07995, -1.6364));
  const Eigen::Array3d optical_depth(0.10, 0.15, 0.27);
  return (-optical_depth * air_mass).exp().cast<float>();
}

float Square(float x) {
  return x * x;
}

float SmoothStep(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

/// Smooth noise of wavelength 1, in [0, 1].
float ValueNoise(float x, float y, std::uint64_t seed) {
  const float x_floor = std::floor(x);
  const float y_floor = std::floor(y);
  const auto ix = static_cast<std::int64_t>(x_floor);
  const auto iy = static_cast<std::int64_t>(y_floor);
  const CounterRandom random(seed);
  const auto corner = [&](std::int64_t dx, std::int64_t dy) {
    return random.Unit(static_cast<std::uint64_t>((ix + dx) * 0x1F123BB5 + (iy + dy) * 0x5851F42D));
  };
  const float u = SmoothStep(0.0F, 1.0F, x - x_floor);
  const float v = SmoothStep(0.0F, 1.0F, y - y_floor);
  const float low = corner(0, 0) + u * (corner(1, 0) - corner(0, 0));
  const float high = corner(0, 1) + u * (corner(1, 1) - corner(0, 1));
  return low + v * (high - low);
}

}  // namespace

Lighting::Lighting(const LightingOptions& options, std::span<const Lamp> lamps)
    : haze_per_m_(static_cast<float>(options.haze_per_m)),
      lamps_on_(options.lamps_on),
      seed_(options.seed) {
  const double elevation = options.sun_elevation_rad;
  to_sun_ = Eigen::Vector3d(std::cos(elevation) * std::cos(options.sun_azimuth_rad),
                            std::cos(elevation) * std::sin(options.sun_azimuth_rad),
                            std::sin(elevation))
                .cast<float>();
  const auto brightness = static_cast<float>(options.sky_brightness);
  const auto strength = static_cast<float>(options.sun_strength);
  const Eigen::Array3f clear_zenith(0.13F, 0.24F, 0.52F);
  const Eigen::Array3f clear_horizon(0.50F, 0.60F, 0.72F);
  const Eigen::Array3f gray(0.62F, 0.65F, 0.70F);
  if (strength > 0.0F) {
    const Eigen::Array3f transmission = SunTransmission(std::max(elevation, 0.01));
    sun_irradiance_ = 1.45F * strength * transmission;
    // A low sun leaves the sky darker and its light warmer.
    const float height = SmoothStep(0.0F, 0.7F, static_cast<float>(elevation));
    const float level = brightness * (0.55F + 0.45F * height);
    zenith_ = level * clear_zenith;
    horizon_ =
        level * (clear_horizon * (0.6F + 0.4F * height) + (1.0F - height) * 0.3F * transmission);
    sun_glow_ = 1.2F * strength;
    cloud_cover_ = static_cast<float>(options.cloud_cover);
  } else {
    sun_irradiance_ = Eigen::Array3f::Zero();
    zenith_ = brightness * gray;
    horizon_ = brightness * 0.75F * gray;
    if (brightness < 0.3F) {
      // Blue dusk, with the last light at the horizon.
      zenith_ = brightness * Eigen::Array3f(0.35F, 0.5F, 0.95F);
      horizon_ = brightness * Eigen::Array3f(1.1F, 0.85F, 0.8F);
    }
  }
  // The mean of a sky that brightens towards the horizon, and a ground of albedo 0.2 below.
  ambient_up_ = 0.62F * zenith_ + 0.38F * horizon_ + 0.12F * cloud_cover_ * brightness;
  const Eigen::Array3f ground =
      0.2F * (ambient_up_ + std::max(to_sun_.z(), 0.0F) * sun_irradiance_);
  ambient_down_ = ground;
  SortLamps(lamps);
}

Eigen::Array3f Lighting::SkyRadiance(const Eigen::Vector3f& direction) const {
  const float up = std::max(direction.z(), 0.0F);
  const float towards_horizon = Square(Square(1.0F - up));
  Eigen::Array3f radiance = zenith_ + towards_horizon * (horizon_ - zenith_);
  if (sun_glow_ > 0.0F) {
    const float cosine = std::max(direction.dot(to_sun_), 0.0F);
    const float power_8 = Square(Square(Square(cosine)));
    const float power_64 = Square(Square(Square(power_8)));
    const float wide = 0.12F * power_8;
    const float narrow = 1.2F * power_64 * Square(power_64);
    radiance += sun_glow_ * (wide + narrow) * sun_irradiance_;
  }
  if (cloud_cover_ > 0.0F || sun_glow_ == 0.0F) {
    const float cloud = CloudAt(direction);
    const Eigen::Array3f lit = sun_glow_ > 0.0F
                                   ? Eigen::Array3f(0.55F * sun_irradiance_ + 0.3F * horizon_)
                                   : Eigen::Array3f(0.8F * zenith_);
    radiance += cloud * (lit - radiance);
  }
  return radiance;
}

float Lighting::CloudAt(const Eigen::Vector3f& direction) const {
  constexpr float kLowest = 0.03F;
  if (direction.z() < kLowest) return 0.0F;
  // On a plane overhead, so that clouds become small towards the horizon.
  const float scale = 1.6F / (direction.z() + 0.12F);
  float x = direction.x() * scale;
  float y = direction.y() * scale;
  float sum = 0.0F;
  float amplitude = 0.5F;
  for (std::uint64_t octave = 0; octave < 4; ++octave) {
    sum += amplitude * ValueNoise(x, y, seed_ + octave);
    x *= 2.1F;
    y *= 2.1F;
    amplitude *= 0.5F;
  }
  const float cover = sun_glow_ > 0.0F ? cloud_cover_ : 0.55F;
  const float threshold = 0.75F - 0.5F * cover;
  const float cloud = SmoothStep(threshold - 0.08F, threshold + 0.2F, sum);
  return 0.9F * cloud * SmoothStep(kLowest, 0.2F, direction.z());
}

Eigen::Array3f Lighting::AmbientIrradiance(const Eigen::Vector3f& normal) const {
  const float up = 0.5F + 0.5F * normal.z();
  return up * ambient_up_ + (1.0F - up) * ambient_down_;
}

std::size_t Lighting::GridIndex(int column, int row) const {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(grid_columns_) +
         static_cast<std::size_t>(column);
}

void Lighting::SortLamps(std::span<const Lamp> lamps) {
  if (!lamps_on_ || lamps.empty()) return;
  Eigen::Array2f low = lamps.front().p_WL.head<2>().array();
  Eigen::Array2f high = low;
  for (const Lamp& lamp : lamps) {
    low = low.min(lamp.p_WL.head<2>().array());
    high = high.max(lamp.p_WL.head<2>().array());
  }
  grid_origin_ = low - kLampReachM;
  const Eigen::Array2f size = (high - low + 2.0F * kLampReachM) / kGridCellM;
  grid_columns_ = static_cast<int>(size.x()) + 1;
  grid_rows_ = static_cast<int>(size.y()) + 1;
  lamp_grid_.resize(static_cast<std::size_t>(grid_columns_) * static_cast<std::size_t>(grid_rows_));
  for (const Lamp& lamp : lamps) {
    const Eigen::Array2f at = lamp.p_WL.head<2>().array() - grid_origin_;
    const Eigen::Array2i from = ((at - kLampReachM) / kGridCellM).floor().cast<int>().max(0);
    const Eigen::Array2i to = ((at + kLampReachM) / kGridCellM).floor().cast<int>();
    for (int row = from.y(); row <= std::min(to.y(), grid_rows_ - 1); ++row) {
      for (int column = from.x(); column <= std::min(to.x(), grid_columns_ - 1); ++column)
        lamp_grid_[GridIndex(column, row)].push_back(lamp);
    }
  }
}

Eigen::Array3f Lighting::LampIrradiance(const Eigen::Vector3f& position,
                                        const Eigen::Vector3f& normal) const {
  Eigen::Array3f sum = Eigen::Array3f::Zero();
  if (lamp_grid_.empty()) return sum;
  const Eigen::Array2f cell = (position.head<2>().array() - grid_origin_) / kGridCellM;
  if (!(cell.minCoeff() >= 0.0F) || !(cell.x() < static_cast<float>(grid_columns_)) ||
      !(cell.y() < static_cast<float>(grid_rows_))) {
    return sum;
  }
  const std::size_t index = GridIndex(static_cast<int>(cell.x()), static_cast<int>(cell.y()));
  for (const Lamp& lamp : lamp_grid_[index]) {
    const Eigen::Vector3f to_lamp = lamp.p_WL - position;
    const float distance = to_lamp.norm();
    if (!(distance < kLampReachM) || !(distance > 0.0F)) continue;
    const Eigen::Vector3f direction = to_lamp / distance;
    const float facing = std::max(normal.dot(direction), 0.0F);
    const float cone = SmoothStep(lamp.cone_cosine - 0.1F, lamp.cone_cosine + 0.25F, direction.z());
    // Fades to nothing at its reach, so that no edge is seen there.
    const float fade = 1.0F - SmoothStep(0.6F * kLampReachM, kLampReachM, distance);
    sum += lamp.intensity * (facing * cone * fade / (distance * distance + 0.05F));
  }
  return sum / std::numbers::pi_v<float>;
}

Eigen::Array3f Lighting::ThroughHaze(const Eigen::Array3f& radiance, float distance_m) const {
  if (haze_per_m_ <= 0.0F) return radiance;
  const float through = std::exp(-haze_per_m_ * distance_m);
  return through * radiance + (1.0F - through) * horizon_;
}

}  // namespace relocd
