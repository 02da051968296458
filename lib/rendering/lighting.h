#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "rendering/scene.h"

namespace relocd {

/// What the light is like. Radiance is relative: a white wall in the noon sun has about 1.
struct LightingOptions {
  double sun_azimuth_rad = 0.6;    ///< From W's x towards y.
  double sun_elevation_rad = 0.9;  ///< Above the horizon, > 0 for a sun that shines.
  double sun_strength = 1.0;       ///< 0: overcast.
  double sky_brightness = 1.0;     ///< Of the sky against that of a day.
  double cloud_cover = 0.4;        ///< Of a sky with a sun, in [0, 1].
  bool lamps_on = false;
  double haze_per_m = 0.0;  ///< Extinction.
  std::uint64_t seed = 0;   ///< Of the clouds.
};

/// Sun, sky, haze and lamps. Immutable, hence thread-safe.
class Lighting {
 public:
  Lighting(const LightingOptions& options, std::span<const Lamp> lamps);

  [[nodiscard]] bool has_sun() const { return sun_irradiance_.maxCoeff() > 0.0F; }
  [[nodiscard]] const Eigen::Vector3f& to_sun() const { return to_sun_; }  ///< In W, of length 1.
  /// On a surface that faces the sun, divided by pi.
  [[nodiscard]] const Eigen::Array3f& sun_irradiance() const { return sun_irradiance_; }

  /// Radiance of the sky in a direction of length 1, without the sun's disk.
  [[nodiscard]] Eigen::Array3f SkyRadiance(const Eigen::Vector3f& direction) const;

  /// Irradiance, divided by pi, of an open sky and of light from the ground on a surface.
  [[nodiscard]] Eigen::Array3f AmbientIrradiance(const Eigen::Vector3f& normal) const;

  /// Irradiance of the lamps near a point, divided by pi, without shadows.
  [[nodiscard]] Eigen::Array3f LampIrradiance(const Eigen::Vector3f& position,
                                              const Eigen::Vector3f& normal) const;
  [[nodiscard]] bool lamps_on() const { return lamps_on_; }

  /// What is seen of `radiance` from a distance through haze.
  [[nodiscard]] Eigen::Array3f ThroughHaze(const Eigen::Array3f& radiance, float distance_m) const;

 private:
  [[nodiscard]] float CloudAt(const Eigen::Vector3f& direction) const;
  void SortLamps(std::span<const Lamp> lamps);
  [[nodiscard]] std::size_t GridIndex(int column, int row) const;

  Eigen::Vector3f to_sun_;
  Eigen::Array3f sun_irradiance_;
  Eigen::Array3f zenith_;
  Eigen::Array3f horizon_;
  Eigen::Array3f ambient_up_;    ///< On a surface that faces up,
  Eigen::Array3f ambient_down_;  ///< and down.
  float sun_glow_ = 0.0F;
  float cloud_cover_ = 0.0F;
  float haze_per_m_ = 0.0F;
  bool lamps_on_ = false;
  std::uint64_t seed_ = 0;

  /// Lamps by the square of the ground that they reach, row-major.
  std::vector<std::vector<Lamp>> lamp_grid_;
  Eigen::Array2f grid_origin_ = Eigen::Array2f::Zero();
  int grid_columns_ = 0;
  int grid_rows_ = 0;
};

}  // namespace relocd
